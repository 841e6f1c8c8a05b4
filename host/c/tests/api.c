// What callers do wrong, and each call once, against `mgw sim` whose axes 0 to 3 are configured.
#define _POSIX_C_SOURCE 200809L
#include <assert.h>
#include <math.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdio.h>
#include <string.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include "mgw.h"

#undef NDEBUG
#define CHECK(condition)                                                                                     \
    do {                                                                                                     \
        if (!(condition)) {                                                                                  \
            fprintf(stderr, "%s:%d: %s is false; the last error was: %s\n", __FILE__, __LINE__, #condition,  \
                    mgw_error_text());                                                                       \
            return 1;                                                                                        \
        }                                                                                                    \
    } while (0)

static bool says(const char *part) { return strstr(mgw_error_text(), part) != NULL; }

// Waits until an axis is in a state, at most 5 s; events that come meanwhile are gone.
static bool becomes(mgw_gateway *gateway, uint8_t axis, mgw_state state, mgw_axis *seen) {
    for (int look = 0; look < 500; look++) {
        mgw_event event;
        if (mgw_read(gateway, axis, seen) != MGW_RESULT_OK) return false;
        if (seen->state == (uint32_t)state) return true;
        if (mgw_poll_event(gateway, 10000, &event) != MGW_RESULT_OK) return false;
    }
    return false;
}

// Is in calls with a handle until it is told to end: each waits for an event that does not come.
static atomic_bool ends = false, is_in_calls = false;
static void *wait_for_events(void *gateway) {
    mgw_event event;
    while (!ends) {
        is_in_calls = true;
        (void)mgw_poll_event(gateway, 100000, &event);
    }
    return NULL;
}

int main(int count, char **arguments) {
    mgw_gateway *gateway = NULL, *other = NULL;
    mgw_axis axis;
    mgw_event event;
    uint32_t epoch = 0;
    const uint8_t axes[] = {0, 1}, twice[] = {1, 1}, far[] = {77};
    if (count < 2) return 2;

    // Nothing was connected, or not to what was meant.
    CHECK(mgw_error_text()[0] == '\0' && mgw_error_number() == 0);
    CHECK(mgw_connect("tcp:127.0.0.1:1", &gateway) == MGW_RESULT_LOST && gateway == NULL);
    gateway = (mgw_gateway *)(void *)&axis;
    CHECK(mgw_connect("tcp:nowhere", &gateway) == MGW_RESULT_LOST && gateway == NULL);
    CHECK(mgw_connect("\xff\xfe", &gateway) == MGW_RESULT_WRONG_ARGUMENT && says("no UTF-8"));
    CHECK(setenv("MGW_SOCKET", "/nowhere", 1) == 0);
    CHECK(mgw_connect(NULL, &gateway) == MGW_RESULT_LOST && says("name the port"));
    CHECK(mgw_connect(arguments[1], NULL) == MGW_RESULT_WRONG_ARGUMENT && says("the pointer is null"));
    CHECK(mgw_stop_all(NULL) == MGW_RESULT_WRONG_ARGUMENT && says("the handle is null"));
    CHECK(mgw_arm(NULL, axes, 2, &epoch) == MGW_RESULT_WRONG_ARGUMENT);
    CHECK(mgw_close(NULL) == MGW_RESULT_OK && mgw_time_us(NULL) == 0);

    CHECK(mgw_connect(arguments[1], &gateway) == MGW_RESULT_OK && gateway != NULL);
    CHECK(mgw_time_us(gateway) > 0);
    CHECK(mgw_arm(gateway, NULL, 2, &epoch) == MGW_RESULT_WRONG_ARGUMENT && says("axes: the pointer is null"));
    CHECK(mgw_arm(gateway, axes, 0, &epoch) == MGW_RESULT_WRONG_ARGUMENT && says("1 at least"));
    CHECK(mgw_arm(gateway, axes, 33, &epoch) == MGW_RESULT_WRONG_ARGUMENT);
    CHECK(says("axes: 33 are too many, 32 at most"));
    CHECK(mgw_arm(gateway, twice, 2, &epoch) == MGW_RESULT_WRONG_ARGUMENT && says("named twice"));
    CHECK(mgw_arm(gateway, far, 1, &epoch) == MGW_RESULT_WRONG_ARGUMENT);
    CHECK(mgw_read(gateway, 31, &axis) == MGW_RESULT_REFUSED && says("axis 31 lacks bus"));
    CHECK(mgw_read(gateway, 1, &axis) == MGW_RESULT_OK && axis.state == MGW_STATE_IDLE && axis.axis == 1);
    // A thruster tells no position.
    CHECK(isnan(axis.position_rad) && axis.result == MGW_CYCLE_RESULT_NONE && axis.trip == MGW_TRIP_REASON_NONE);
    CHECK(mgw_read(gateway, 99, NULL) == MGW_RESULT_REFUSED && mgw_error_number() != 0);

    // Armed, moved, one wrong setpoint, another host.
    CHECK(mgw_arm(gateway, axes, 2, &epoch) == MGW_RESULT_OK && epoch != 0);
    CHECK(mgw_connect(arguments[1], &other) == MGW_RESULT_OK);
    CHECK(mgw_arm(other, axes, 2, NULL) == MGW_RESULT_REFUSED && says("command"));
    mgw_setpoint setpoints[] = {
        {.axis = 1, .mode = MGW_MODE_SIGNAL, .fraction = 0.05f},
        {.axis = 0, .mode = MGW_MODE_VELOCITY, .velocity_rad_s = 1.0f},
    };
    mgw_axis states[2];
    CHECK(mgw_cycle(gateway, epoch, NULL, 2, 100000, states) == MGW_RESULT_WRONG_ARGUMENT);
    CHECK(mgw_cycle(gateway, epoch, setpoints, 17, 100000, NULL) == MGW_RESULT_WRONG_ARGUMENT);
    CHECK(says("setpoints: 17 are too many, 16 at most"));
    CHECK(mgw_cycle(gateway, epoch, setpoints, SIZE_MAX, 1000, NULL) == MGW_RESULT_WRONG_ARGUMENT);
    CHECK(says("too many"));
    for (int cycle = 0; cycle < 50; cycle++) {
        CHECK(mgw_cycle(gateway, epoch, setpoints, 2, 1000000, states) == MGW_RESULT_OK);
        // In the order of the setpoints.
        CHECK(states[0].axis == 1 && states[1].axis == 0);
        CHECK(states[1].result != MGW_CYCLE_RESULT_NONE && states[1].trip == MGW_TRIP_REASON_NONE);
    }
    CHECK(mgw_cycle(gateway, epoch, setpoints, 2, 1000000, NULL) == MGW_RESULT_OK);
    CHECK(mgw_set(gateway, epoch, NULL, 1000000) == MGW_RESULT_WRONG_ARGUMENT);
    CHECK(mgw_set(gateway, epoch, &setpoints[1], 1000000) == MGW_RESULT_OK);
    CHECK(mgw_set(gateway, epoch, &setpoints[1], 0) == MGW_RESULT_WRONG_ARGUMENT);
    CHECK(says("ttl_us: 1 at least"));
    CHECK(mgw_cycle(gateway, epoch, setpoints, 2, 0, states) == MGW_RESULT_WRONG_ARGUMENT);
    CHECK(mgw_set(gateway, epoch + 1, &setpoints[1], 1000000) == MGW_RESULT_REFUSED && mgw_error_number() != 0);
    setpoints[0].mode = 5;
    CHECK(mgw_cycle(gateway, epoch, setpoints, 2, 1000000, states) == MGW_RESULT_WRONG_ARGUMENT);
    CHECK(says("mode 5; there are 0 to 4"));
    setpoints[0].mode = MGW_MODE_SIGNAL;
    setpoints[0].fraction = NAN;
    CHECK(mgw_set(gateway, epoch, &setpoints[0], 1000000) == MGW_RESULT_REFUSED);

    // Whoever is not in command may stop, and the one in command is told.
    CHECK(mgw_stop(other, 0) == MGW_RESULT_OK);
    CHECK(becomes(other, 0, MGW_STATE_HOLDING, &axis));
    bool told = false;
    do {
        CHECK(mgw_poll_event(gateway, 1000000, &event) == MGW_RESULT_OK);
        told |= event.kind == MGW_EVENT_KIND_STOP_CONFIRMED && event.axis.axis == 0;
    } while (!told && event.kind != MGW_EVENT_KIND_NONE);
    CHECK(told && event.axis.stop_confirmed && event.number != 0 && event.time_us > 0);
    CHECK(mgw_output_off(gateway, 0) == MGW_RESULT_OK);
    CHECK(becomes(gateway, 0, MGW_STATE_IDLE, &axis));
    CHECK(mgw_disarm(gateway, 1) == MGW_RESULT_OK);
    CHECK(becomes(gateway, 1, MGW_STATE_IDLE, &axis));

    // The e-stop latches until it is cleared, and axes trip only where they may move.
    CHECK(mgw_arm(gateway, axes, 1, &epoch) == MGW_RESULT_OK);
    CHECK(mgw_estop(other) == MGW_RESULT_OK);
    CHECK(becomes(gateway, 0, MGW_STATE_TRIPPED, &axis) && axis.trip == MGW_TRIP_REASON_E_STOP);
    CHECK(mgw_arm(gateway, axes, 1, &epoch) == MGW_RESULT_REFUSED);
    for (int look = 0; look < 500 && !axis.stop_confirmed; look++) {
        CHECK(mgw_keep_alive(gateway) == MGW_RESULT_OK);
        CHECK(mgw_poll_event(gateway, 10000, NULL) == MGW_RESULT_OK);
        CHECK(mgw_read(gateway, 0, &axis) == MGW_RESULT_OK);
    }
    CHECK(axis.stop_confirmed);
    CHECK(mgw_clear_gateway(gateway) == MGW_RESULT_OK);
    CHECK(mgw_clear(gateway, 0) == MGW_RESULT_OK);

    // A handle is of one thread and one process.
    pthread_t thread;
    CHECK(pthread_create(&thread, NULL, wait_for_events, other) == 0);
    while (!is_in_calls) nanosleep(&(struct timespec){.tv_nsec = 1000000}, NULL);
    mgw_result used = MGW_RESULT_OK;
    for (int look = 0; look < 10000 && used == MGW_RESULT_OK; look++) used = mgw_stop(other, 3);
    ends = true;
    CHECK(used == MGW_RESULT_WRONG_ARGUMENT && says("another thread"));
    CHECK(pthread_join(thread, NULL) == 0 && mgw_stop(other, 3) == MGW_RESULT_OK);
    const pid_t child = fork();
    if (child == 0) {
        _exit(mgw_close(other) == MGW_RESULT_WRONG_ARGUMENT && says("after a fork") ? 0 : 1);
    }
    int status = -1;
    CHECK(child > 0 && waitpid(child, &status, 0) == child && status == 0);

    // Leaving a handle stops what it has armed.
    CHECK(mgw_arm(gateway, axes, 1, &epoch) == MGW_RESULT_OK);
    CHECK(mgw_close(gateway) == MGW_RESULT_OK);
    CHECK(becomes(other, 0, MGW_STATE_HOLDING, &axis));
    // Events that nobody reads are lost, and counted: each round makes two of these.
    uint64_t latches = 0, lost = 0;
    for (int round = 0; round < 800; round++) {
        CHECK(mgw_estop(other) == MGW_RESULT_OK && mgw_clear_gateway(other) == MGW_RESULT_OK);
    }
    do {
        CHECK(mgw_poll_event(other, 100000, &event) == MGW_RESULT_OK);
        latches += event.kind == MGW_EVENT_KIND_ESTOP_LATCHED;
        latches += event.kind == MGW_EVENT_KIND_ESTOP_CLEARED;
        lost += event.dropped;
    } while (event.kind != MGW_EVENT_KIND_NONE);
    CHECK(latches < 1600 && latches + lost >= 1600);
    CHECK(mgw_close(other) == MGW_RESULT_OK);
    CHECK(mgw_close(other) == MGW_RESULT_WRONG_ARGUMENT && says("the handle is not open"));
    CHECK(mgw_stop_all(gateway) == MGW_RESULT_WRONG_ARGUMENT && mgw_time_us(gateway) == 0);
    CHECK(mgw_stop_all((mgw_gateway *)(void *)&axis) == MGW_RESULT_WRONG_ARGUMENT);
    puts("all of it passed");
    return 0;
}
