// The motor gateway for C. Written by cbindgen from host/c/src: `.ci/c header` writes it anew.

#ifndef MGW_H
#define MGW_H

#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>

// How a call ended.
typedef enum {
  // It is done.
  MGW_RESULT_OK = 0,
  // The gateway refused it, or could not do it: `mgw_error_number` has the number of
  // PROTOCOL.md.
  MGW_RESULT_REFUSED = 1,
  // No answer came in time. Whether it was done is not known.
  MGW_RESULT_NO_ANSWER = 2,
  // The connection failed, or could not be made.
  MGW_RESULT_LOST = 3,
  // A stop was sent and nothing answered. The gateway may have stopped the motors all the same,
  // and does when it no longer hears this host.
  MGW_RESULT_STOP_NOT_CONFIRMED = 4,
  // An argument is wrong; nothing was sent.
  MGW_RESULT_WRONG_ARGUMENT = 5,
} mgw_result;

// What a setpoint is.
typedef enum {
  // A fraction of the full signal, −1 to 1: thrusters.
  MGW_MODE_SIGNAL = 0,
  // A current, A; positive drives counter-clockwise.
  MGW_MODE_CURRENT = 1,
  // A velocity, rad/s; positive is counter-clockwise.
  MGW_MODE_VELOCITY = 2,
  // A position, rad, approached at most at `speed_limit_rad_s`.
  MGW_MODE_POSITION = 3,
  // A spring to `position_rad` and a damper to `velocity_rad_s`, and a torque: RMD on CAN.
  MGW_MODE_IMPEDANCE = 4,
} mgw_mode;

// The state of an axis.
typedef enum {
  // A required parameter is missing.
  MGW_STATE_UNCONFIGURED = 0,
  // Nothing moves and nothing may.
  MGW_STATE_IDLE = 1,
  // The steps before motion are under way.
  MGW_STATE_ARMING = 2,
  // Motion is allowed; no setpoint has come yet.
  MGW_STATE_ARMED = 3,
  // A setpoint is in force.
  MGW_STATE_ACTIVE = 4,
  // The stop is under way.
  MGW_STATE_STOPPING = 5,
  // The gateway has stopped it; `stop_confirmed` says whether the motor has confirmed that.
  MGW_STATE_TRIPPED = 6,
  // At rest, the motor's output on.
  MGW_STATE_HOLDING = 7,
} mgw_state;

// What became of a setpoint of `mgw_cycle`.
typedef enum {
  // The motor has answered it.
  MGW_CYCLE_RESULT_ANSWERED = 0,
  // It has not, in its time.
  MGW_CYCLE_RESULT_NO_REPLY = 1,
  // A stop came before.
  MGW_CYCLE_RESULT_STOPPED = 2,
  // A newer setpoint came before.
  MGW_CYCLE_RESULT_SUPERSEDED = 3,
  // It was not taken, for the error in `error`.
  MGW_CYCLE_RESULT_REFUSED = 4,
  // It has, and that may be the late answer to one before.
  MGW_CYCLE_RESULT_AMBIGUOUS = 5,
  // There was no setpoint.
  MGW_CYCLE_RESULT_NONE = 6,
} mgw_cycle_result;

// Why an axis tripped.
typedef enum {
  // It has not.
  MGW_TRIP_REASON_NONE = 0,
  // No new setpoint came before the last one expired.
  MGW_TRIP_REASON_SETPOINT_EXPIRED = 1,
  // Nothing valid came from the host in command.
  MGW_TRIP_REASON_HOST_SILENT = 2,
  // The motor did not reply.
  MGW_TRIP_REASON_MOTOR_SILENT = 3,
  // The motor reports a fault.
  MGW_TRIP_REASON_MOTOR_FAULT = 4,
  // The motor refused a command.
  MGW_TRIP_REASON_COMMAND_REFUSED = 5,
  // No node acknowledged a frame.
  MGW_TRIP_REASON_NOT_ACKNOWLEDGED = 6,
  // The CAN controller of its bus switched itself off.
  MGW_TRIP_REASON_BUS_OFF = 7,
  // A measured value is beyond a limit.
  MGW_TRIP_REASON_LIMIT_EXCEEDED = 8,
  // Emergency stop.
  MGW_TRIP_REASON_E_STOP = 9,
  // The gateway was reset while the axis was in motion.
  MGW_TRIP_REASON_RESET = 10,
  // The gateway found itself in a state that should not be.
  MGW_TRIP_REASON_INTERNAL = 11,
  // A requested stop was not confirmed by the motor.
  MGW_TRIP_REASON_STOP_UNCONFIRMED = 12,
  // Another axis of its trip group tripped.
  MGW_TRIP_REASON_GROUP = 13,
  // The motor turned although the axis had no setpoint.
  MGW_TRIP_REASON_UNCOMMANDED = 14,
  // A setpoint was accepted and not sent in time.
  MGW_TRIP_REASON_NOT_DELIVERED = 15,
  // The motor restarted by itself.
  MGW_TRIP_REASON_MOTOR_RESTARTED = 16,
} mgw_trip_reason;

// What happened.
typedef enum {
  // Nothing, in the time that was given.
  MGW_EVENT_KIND_NONE = 0,
  // An axis tripped: `axis.trip` says why.
  MGW_EVENT_KIND_TRIPPED = 1,
  // A stop is confirmed: `axis.stop_confirmed`.
  MGW_EVENT_KIND_STOP_CONFIRMED = 2,
  // An axis is in another state: `axis.state`.
  MGW_EVENT_KIND_STATE_CHANGED = 3,
  // This host has no right to command any more: what it had armed stops.
  MGW_EVENT_KIND_AUTHORITY_LOST = 4,
  // The e-stop is latched: nothing arms.
  MGW_EVENT_KIND_ESTOP_LATCHED = 5,
  // The e-stop is cleared.
  MGW_EVENT_KIND_ESTOP_CLEARED = 6,
  // The stops of an axis stay unconfirmed: its motor may be turning.
  MGW_EVENT_KIND_AXIS_UNREACHABLE = 7,
  // A stop has not left in its time.
  MGW_EVENT_KIND_STOP_DELAYED = 8,
  // Something else of PROTOCOL.md: `number`.
  MGW_EVENT_KIND_OTHER = 9,
} mgw_event_kind;

// A connection to a gateway. It belongs to one thread at a time, and to the process that made it:
// another one is refused.
typedef struct mgw_gateway mgw_gateway;

// A setpoint for an axis. Only what its mode names counts; the rest may be 0.
typedef struct {
  // Number of the axis, from 0.
  uint8_t axis;
  // A `mgw_mode`.
  uint32_t mode;
  // −1 to 1.
  float fraction;
  // A.
  float current_a;
  // rad/s.
  float velocity_rad_s;
  // rad.
  float position_rad;
  // rad/s, above 0.
  float speed_limit_rad_s;
  // N·m/rad, from 0.
  float stiffness_nm_per_rad;
  // N·m·s/rad, from 0.
  float damping_nm_s_per_rad;
  // N·m.
  float torque_nm;
} mgw_setpoint;

// How an axis is. What is not known is NaN.
typedef struct {
  // Number of the axis, from 0.
  uint8_t axis;
  // Of a tripped axis: whether the motor has confirmed its stop.
  bool stop_confirmed;
  // Whether `faults` is known.
  bool has_faults;
  // The motor's own fault word.
  uint16_t faults;
  // Of `mgw_cycle`: the number of the error for which the setpoint was not taken, else 0.
  uint16_t error;
  // A `mgw_state`.
  uint32_t state;
  // Of `mgw_cycle`: a `mgw_cycle_result`.
  uint32_t result;
  // Of `mgw_read` and events: a `mgw_trip_reason`.
  uint32_t trip;
  // How old the oldest of position, velocity and current is, µs.
  uint32_t age_us;
  // rad; positive is counter-clockwise.
  float position_rad;
  // rad/s.
  float velocity_rad_s;
  // A.
  float current_a;
  // V.
  float voltage_v;
  // °C.
  float motor_temperature_c;
  // °C.
  float driver_temperature_c;
} mgw_axis;

// An event.
typedef struct {
  // A `mgw_event_kind`.
  uint32_t kind;
  // The number of the event in PROTOCOL.md.
  uint16_t number;
  // Events that were lost since the call before: in the gateway, on the way, or here, where 1024
  // wait to be read.
  uint32_t dropped;
  // Gateway time, µs.
  uint64_t time_us;
  // The axis that it is of; `axis.axis` is 255 where it is of none. Of the rest only what the
  // kind names counts.
  mgw_axis axis;
} mgw_event;

#ifdef __cplusplus
extern "C" {
#endif // __cplusplus

// Arms so many axes, 32 at most, in one epoch, all of them or none, and writes the epoch to
// `epoch`. It takes the right to command. Steps that the motors need take up to some hundreds of
// milliseconds.
//
// # Safety
// `axes` is null or the first of `count` numbers; `epoch` is null or a place for a number.
mgw_result mgw_arm(mgw_gateway *gateway, const uint8_t *axes, size_t count, uint32_t *epoch);

// Ends the permission to move, through the stop action of the axis.
mgw_result mgw_disarm(mgw_gateway *gateway, uint8_t axis);

// Gives one armed axis a setpoint that lives `ttl_us` µs: without another the gateway stops it
// then.
//
// # Safety
// `setpoint` is null or one.
mgw_result mgw_set(mgw_gateway *gateway,
                   uint32_t epoch,
                   const mgw_setpoint *setpoint,
                   uint32_t ttl_us);

// Gives so many axes that were armed together each its setpoint, which lives `ttl_us` µs, and
// waits until every motor has answered or its own time is over. Where `states` is not null, the
// state of each is written there, in the order of the setpoints; `count` of them must fit, which
// is 16 at most. Call it again before the setpoints expire.
//
// # Safety
// `setpoints` is null or the first of `count`; `states` is null or the first of `count` places.
mgw_result mgw_cycle(mgw_gateway *gateway,
                     uint32_t epoch,
                     const mgw_setpoint *setpoints,
                     size_t count,
                     uint32_t ttl_us,
                     mgw_axis *states);

// Reads how an axis is: its state, why it tripped, and what was measured last.
//
// # Safety
// `axis_state` is null or a place for it.
mgw_result mgw_read(mgw_gateway *gateway, uint8_t axis, mgw_axis *axis_state);

// Stops an axis; needs no right to command. It is repeated until it is answered, for 3 s at most.
// OK says that the gateway has taken it: that the motor has stopped is told by
// `MGW_EVENT_KIND_STOP_CONFIRMED`, that it has not by a trip.
mgw_result mgw_stop(mgw_gateway *gateway, uint8_t axis);

// Stops every axis; needs no right to command. As `mgw_stop`.
mgw_result mgw_stop_all(mgw_gateway *gateway);

// Emergency stop: everything stops, and nothing arms until `mgw_clear_gateway`. As `mgw_stop`.
mgw_result mgw_estop(mgw_gateway *gateway);

// Clears the trip of an axis whose stop is confirmed and whose cause is gone. Never arms.
mgw_result mgw_clear(mgw_gateway *gateway, uint8_t axis);

// Clears the latched e-stop. Never arms.
mgw_result mgw_clear_gateway(mgw_gateway *gateway);

// Switches the output of a holding motor off: it lets go.
mgw_result mgw_output_off(mgw_gateway *gateway, uint8_t axis);

// Connects to a gateway and writes a handle to `gateway`, which `mgw_close` takes back, or null
// where it fails. `port` is a serial device, `DEVICE@RATE`, `tcp:HOST:PORT` or `unix:PATH`; null:
// the running `mgw serve` of this user.
//
// # Safety
// `port` is null or a text with a zero behind it; `gateway` is a place for a pointer.
mgw_result mgw_connect(const char *port, mgw_gateway **gateway);

// Stops what was armed over this handle, as `mgw_stop` does, and disconnects without waiting for
// the motors. The handle is gone whatever comes back, unless it was refused as an argument; null
// does nothing.
mgw_result mgw_close(mgw_gateway *gateway);

// Keeps the right to command while nothing else is asked: the gateway takes it away, and trips
// what is armed, when it has not heard this host for 250 ms unless configured otherwise.
mgw_result mgw_keep_alive(mgw_gateway *gateway);

// The gateway's time now, µs, as this host knows it from what it has heard; 0 without a handle
// that this thread can use.
uint64_t mgw_time_us(const mgw_gateway *gateway);

// What was wrong with the last call of this thread that failed, and what to do, as UTF-8. It is
// valid until the next call of this thread that fails; empty before the first.
const char *mgw_error_text(void);

// The number of the gateway's error behind the last call of this thread that failed, as
// PROTOCOL.md lists them; 0 where it was none.
uint16_t mgw_error_number(void);

// Waits at most `timeout_us` µs for the next event and writes it to `event`: of kind
// `MGW_EVENT_KIND_NONE` where none came. It sends nothing: what is armed needs setpoints
// meanwhile, and a gateway that has restarted behind an open cable tells events from the next
// `mgw_keep_alive`, `mgw_set` or `mgw_cycle` on.
//
// # Safety
// `event` is null or a place for one.
mgw_result mgw_poll_event(mgw_gateway *gateway, uint32_t timeout_us, mgw_event *event);

#ifdef __cplusplus
}  // extern "C"
#endif  // __cplusplus

#endif  /* MGW_H */
