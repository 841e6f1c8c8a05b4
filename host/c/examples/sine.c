// Two axes follow sines for a second; then nobody sends setpoints any more, and the gateway stops both.
//
//   mgw sim &
//   cc -I ../include sine.c -lmgw -lm -o sine && ./sine tcp:127.0.0.1:7401
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "mgw.h"

// How long a setpoint lives: a few periods of a loop in real time, more on a desktop. The axis
// allows no more than its ttl_us, and what outlives the gateway's link_silence_us ends with that.
#ifndef TTL_US
#define TTL_US 100000u
#endif

static mgw_gateway *gateway = NULL;

// Ends with a failure; leaving the handle stops what is armed.
static void check(mgw_result result, const char *what) {
    if (result != MGW_RESULT_OK) {
        fprintf(stderr, "%s: %s\n", what, mgw_error_text());
        mgw_close(gateway);
        exit(1);
    }
}

int main(int count, char **arguments) {
    const uint8_t axes[] = {0, 1};
    uint32_t epoch;
    mgw_axis states[2];

    check(mgw_connect(count > 1 ? arguments[1] : NULL, &gateway), "connect");
    check(mgw_arm(gateway, axes, 2, &epoch), "arm");

    const uint64_t begin = mgw_time_us(gateway);
    double seconds;
    unsigned cycles = 0;
    while ((seconds = (double)(mgw_time_us(gateway) - begin) / 1e6) < 1.0) {
        const mgw_setpoint setpoints[] = {
            {.axis = 0, .mode = MGW_MODE_VELOCITY, .velocity_rad_s = (float)(2.0 * sin(6.28 * seconds))},
            {.axis = 1, .mode = MGW_MODE_SIGNAL, .fraction = (float)(0.1 * sin(6.28 * seconds))},
        };
        check(mgw_cycle(gateway, epoch, setpoints, 2, TTL_US, states), "cycle");
        for (int at = 0; at < 2; at++) {
            if (states[at].result == MGW_CYCLE_RESULT_REFUSED) {
                fprintf(stderr, "axis %d: error %d\n", states[at].axis, states[at].error);
                mgw_close(gateway);
                return 1;
            }
        }
        cycles++;
    }
    printf("%s after %u cycles: %.3f rad, %.3f rad/s\n", cycles > 9 ? "done" : "slow", cycles, states[0].position_rad,
           states[0].velocity_rad_s);

    // From here on nobody sends setpoints: the gateway stops both when they expire, and says why.
    mgw_event event;
    do {
        check(mgw_poll_event(gateway, 1000000, &event), "event");
    } while (event.kind != MGW_EVENT_KIND_TRIPPED && event.kind != MGW_EVENT_KIND_NONE);
    printf("axis %d tripped: %s\n", event.axis.axis,
           event.axis.trip == MGW_TRIP_REASON_SETPOINT_EXPIRED ? "its setpoint expired" : "another reason");

    check(mgw_close(gateway), "close");
    return 0;
}
