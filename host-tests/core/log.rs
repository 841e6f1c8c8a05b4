//! The log of whoever runs the core.

use crate::bench::{self, VELOCITY, arm, setpoint};
use crate::rig::Rig;
use gateway::LogEntry;
use host_protocol::{AuthorityLossReason, AxisState, Event, StopAction, TripReason};

fn log(rig: &mut Rig) -> Vec<LogEntry> {
    std::iter::from_fn(|| rig.gateway.take_log()).collect()
}

#[test]
fn the_log_tells_who_commands_and_how_an_axis_fares_in_order() {
    let (mut rig, _) = bench::rmd(StopAction::Hold);
    let begin = log(&mut rig);
    assert!(begin.starts_with(&[
        LogEntry::Event(Event::EStopInputChanged { open: false }),
        LogEntry::Hello { link: 0 },
        LogEntry::InCommand { link: 0 },
    ]));
    let epoch = arm(&mut rig);
    let request = setpoint(&rig, epoch, 60_000, VELOCITY);
    rig.ask(request).unwrap();
    rig.run(400_000);
    let log = log(&mut rig);
    let place = |wanted: &dyn Fn(&LogEntry) -> bool| log.iter().position(wanted).expect("an entry");
    let state = |wanted| {
        place(&|entry| *entry == LogEntry::Event(Event::StateChanged { axis: 0, state: wanted }))
    };
    let places = [
        state(AxisState::Armed),
        place(&|entry| match entry {
            LogEntry::Event(Event::Tripped { axis: 0, trip }) => {
                trip.reason == TripReason::SetpointExpired
            }
            _ => false,
        }),
        place(&|entry| matches!(entry, LogEntry::Event(Event::StopConfirmed { axis: 0, .. }))),
        place(&|entry| {
            *entry == LogEntry::Event(Event::AuthorityLost { reason: AuthorityLossReason::Silence })
        }),
    ];
    assert!(places.is_sorted(), "{log:?}");
}

#[test]
fn a_log_that_nobody_takes_counts_what_it_loses_and_goes_on() {
    let mut rig = bench::rmd_axes(1);
    log(&mut rig);
    for open in [true, false].into_iter().cycle().take(50) {
        rig.handle(gateway::Event::EStopInput { open });
    }
    let entries = log(&mut rig);
    let [LogEntry::Dropped { count }, kept @ .., latest] = &entries[..] else {
        panic!("the loss comes first: {entries:?}")
    };
    assert!(!kept.iter().any(|entry| matches!(entry, LogEntry::Dropped { .. })), "{entries:?}");
    assert_eq!(*latest, LogEntry::Event(Event::EStopInputChanged { open: false }));
    assert!(*count >= 50 - 40, "{count} lost of 50 and more");
    assert_eq!(log(&mut rig), []);
    rig.handle(gateway::Event::EStopInput { open: true });
    assert_eq!(log(&mut rig), [LogEntry::Event(Event::EStopInputChanged { open: true })]);
}
