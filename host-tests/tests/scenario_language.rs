//! What the runner of scenarios owes whoever writes one: a wrong line fails, a failure is told, a
//! seed gives the same run again.

use host_tests::scenario::run;

#[test]
fn a_scenario_that_is_wrong_fails() {
    let failing = "four-axes\nmark\nrun 10 ms\nexpect wire 0 141#A1";
    let error = run(failing, 1).unwrap_err();
    assert!(error.contains("line 4") && error.contains("seen 0 times"), "{error}");
    for wrong in [
        "expect moving 0",
        "expect turned 0 0.1 1",
        "refused NotArmed arm 0",
        "refused NotArmed set 0 velocity 1.0\nexpect refusal Tripped",
        "unanswered 1 s ping",
        "as 1 refused NotInCommand ping",
        "mark\narm 0\nexpect no-wire 0 141#81",
        "mark\narm 0\nexpect wire-count 0 141#81 3",
        "mark\narm 0\nexpect wire-order 0 141#9A 141#81",
        "mark\narm 0\nkeep 0 velocity 1.0\nrun 200 ms\nexpect spacing 0 141#A2 1 ms 2 ms",
        "mark\narm 0\nrun 5 ms\nexpect no-event StateChanged { axis: 0, state: Armed",
        "inject 0 mute",
        "motor 0 rmd 2",
        "power 9 off",
        "release-backlog",
        "arm 0\nset 0 velocity 1.0\nsilence 200 ms\nrun 10 ms\nmark\nexpect trip-time 0 0 ms 1 s",
        "arm 0\nset 0 velocity 1.0\nsilence 200 ms\nexpect trip-values 0 velocity 5 6",
        "arm 0\nstop 0\nrun 100 ms\nexpect reaction 0 10 us",
        "expect reaction 0 1 s",
        "expect acknowledged 0 yes",
        "expect enable-output off",
        "expect incidents 2",
        "expect incident 0 Tripped",
        "expect boot Watchdog",
        "expect crash-report gone",
        "await 0 141#A2",
        "dance",
    ] {
        assert!(run(&format!("four-axes\n{wrong}"), 1).is_err(), "{wrong}");
    }
}

#[test]
fn a_failure_is_told_so_that_a_person_can_follow_it() {
    let failing =
        "four-axes\narm 0\nmark\nkeep 0 velocity 1.0\nrun 50 ms\nexpect wire 0 141#81 within 30 ms";
    let error = run(failing, 3).unwrap_err();
    for part in [
        "line 6: expect wire 0 141#81 within 30 ms",
        "axis 0 is active",
        "bus 0  gateway   141#A2",
        "bus 0  motor 0   241#A2",
        "event",
        "StateChanged { axis: 0, state: Active }",
        "command 0xA2 velocity",
    ] {
        assert!(error.contains(part), "{part} is missing in\n{error}");
    }
}

#[test]
fn the_same_seed_gives_the_same_run_and_another_one_another() {
    let text =
        "four-axes\narm 0 1 2 3\nkeep 0 velocity 1.0\nrun 200 ms\nreconnect\nas 1 ping\nrun 50 ms";
    let trace = |seed| host_tests::scenario::trace(text, seed).unwrap();
    assert_eq!(trace(1), trace(1));
    assert_ne!(trace(1), trace(2));
}
