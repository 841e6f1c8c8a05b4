//! Names of the gateway, its buses and its axes: literal bytes, pages, and what a reset leaves.

use crate::bench;
use crate::rig::Rig;
use gateway::{Event, MAX_STORED_ROW};
use host_protocol::{
    AxisParameter, Change, Error, MAX_FRAME, Reply, Request, Subject, Text, Value, replies,
    requests,
};

fn name(of: Subject, name: Option<&str>) -> Change {
    Change::Name { of, name: name.map(|name| Text::try_from(name).unwrap()) }
}

fn change(rig: &mut Rig, changes: &[Change]) -> Result<Reply, Error> {
    rig.ask(Request::BeginChanges(requests::BeginChanges {})).unwrap();
    for changes in changes.chunks(requests::MAX_CHANGES_AT_ONCE) {
        let changes = changes.iter().cloned().collect();
        rig.ask(Request::AddChanges(requests::AddChanges { changes }))?;
    }
    rig.ask(Request::ApplyChanges(requests::ApplyChanges {}))
}

fn page(rig: &mut Rig, first: Subject) -> replies::NameList {
    match rig.ask(Request::ReadNames(requests::ReadNames { first })) {
        Ok(Reply::ReadNames(list)) => list,
        other => panic!("{other:?}"),
    }
}

fn names(rig: &mut Rig) -> Vec<(Subject, String)> {
    let (mut all, mut first) = (Vec::new(), Some(Subject::Gateway));
    while let Some(from) = first {
        let list = page(rig, from);
        all.extend(list.names.iter().map(|named| (named.of, named.name.as_str().to_owned())));
        first = list.next;
    }
    all
}

/// Bytes on the link and what comes back, as PROTOCOL.md has them and as the golden vectors were
/// made elsewhere.
#[test]
fn an_axis_is_named_and_read_byte_for_byte() {
    let mut rig = bench::rmd_axes(1);
    let hex = |text: &str| -> Vec<u8> {
        let digits = text.as_bytes().chunks(2);
        digits.map(|pair| u8::from_str_radix(str::from_utf8(pair).unwrap(), 16).unwrap()).collect()
    };
    for (sent, answer) in [
        // Begin, add, apply.
        ("000301610214051068EAAD00", "00030261021405E4D8D9E500"),
        ("000301620215040103020B01046C656674EC05F16400", "00030262021505AAC9599400"),
        ("000301630216057F7BC83500", "000302630216058BCBFB7D00"),
        // Read: one, axis 0, and there are no more.
        ("00030164021B0105E6F57BD600", "00030264021B03010206046C656674057B1C405B00"),
        // `2nd` is none, and a text that is no UTF-8 no body.
        ("00030165021405E359C8D600", "0003026502140517E9FB9E00"),
        ("000301660215040103020A0103326E646B4DD1BF00", "000303660278020205BE6C54A500"),
        ("00030167021504010302090102C32839AB6E0B00", "000303670202061593E7D98D00"),
        // 17 bytes are no body either.
        (
            "000301680215040103021801116162636465666768696A6B6C6D6E6F70713412DAE900",
            "000303680202061546E2C8E000",
        ),
    ] {
        let (now, mut out) = (rig.now(), [0; MAX_FRAME]);
        let event = Event::HostBytes { link: 0, bytes: &hex(sent) };
        rig.gateway.handle(now, event, &mut |_, _| {});
        let length = rig.gateway.poll_host(0, &mut out, &mut |_, _| {}).unwrap();
        assert_eq!(out[..length], hex(answer), "{sent}");
    }
}

#[test]
fn a_list_of_names_has_pages_in_order() {
    let mut rig = bench::rmd_axes(20);
    let axes =
        (0..20).map(|axis| name(Subject::Axis(axis), Some(&format!("axis-number-{axis:04}"))));
    let mut changes: Vec<Change> = axes.collect();
    changes.push(name(Subject::Bus(0), Some("b")));
    change(&mut rig, &changes).unwrap();
    change(&mut rig, &[name(Subject::Gateway, Some("g"))]).unwrap();
    let first = page(&mut rig, Subject::Gateway);
    assert_eq!((first.names.len(), first.next), (16, Some(Subject::Axis(14))));
    let all = names(&mut rig);
    assert_eq!(all.len(), 22);
    assert_eq!(all[1], (Subject::Bus(0), "b".to_owned()));
    assert_eq!(all[21], (Subject::Axis(19), "axis-number-0019".to_owned()));
    assert_eq!(page(&mut rig, Subject::Axis(200)).names.len(), 0);
    assert_eq!(page(&mut rig, Subject::Bus(255)).names.len(), 0);
}

/// A name is short for itself, and a word of it that stays costs no place in a list.
#[test]
fn a_shorter_name_leaves_nothing_of_the_longer_one() {
    let mut rig = bench::rmd_axes(2);
    for text in ["abcdefghijklmnop", "abcdefgh", "abcde", "a", "abcdefghijklmno"] {
        change(&mut rig, &[name(Subject::Axis(1), Some(text))]).unwrap();
        assert_eq!(names(&mut rig), [(Subject::Axis(1), text.to_owned())]);
    }
    // The same again changes nothing, and is no mistake.
    let again = name(Subject::Axis(1), Some("abcdefghijklmno"));
    change(&mut rig, &vec![again; 200]).unwrap();
    change(&mut rig, &[name(Subject::Axis(1), None)]).unwrap();
    assert_eq!(names(&mut rig), []);
}

/// The row of an axis ends with its name, and a loss of power brings it back with the row.
#[test]
fn the_stored_row_of_an_axis_has_its_name() {
    let mut rig = bench::rmd_axes(1);
    change(&mut rig, &[name(Subject::Axis(0), Some("left")), name(Subject::Gateway, Some("g"))])
        .unwrap();
    let mut row = [0; MAX_STORED_ROW];
    let length = rig.gateway.stored_row(5, &mut row);
    // Variant 3, axis 0, there is one, four bytes.
    assert_eq!(row[..length].last_chunk(), Some(b"\x03\x02\x00\x01\x04left"));
    let length = rig.gateway.stored_row(0, &mut row);
    assert_eq!(row[..length].last_chunk(), Some(b"\x03\x00\x01\x01g"));
}

/// Names are one of a kind among buses, and among axes.
#[test]
fn the_gateway_keeps_a_name_that_one_of_its_buses_has_too() {
    let mut rig = bench::rmd_axes(1);
    let all = [(Subject::Gateway, "left"), (Subject::Bus(0), "left"), (Subject::Axis(0), "left")];
    change(&mut rig, &all.map(|(of, text)| name(of, Some(text)))).unwrap();
    rig.reset();
    bench::hello(&mut rig);
    assert_eq!(names(&mut rig), all.map(|(of, text)| (of, text.to_owned())));
}

/// The board is reset behind each word of what is stored for two names and a parameter that change
/// together: they are as before, as after, or the e-stop says that they are neither.
#[test]
fn a_reset_leaves_each_name_whole() {
    let mut rig = bench::rmd_axes(2);
    let named = |zero, one| [(Subject::Axis(0), zero), (Subject::Axis(1), one)];
    let owned = |named: [(Subject, &str); 2]| named.map(|(of, text)| (of, text.to_owned()));
    let change_to =
        |named: [(Subject, &'static str); 2]| named.map(|(of, text)| name(of, Some(text)));
    change(&mut rig, &change_to(named("left", "right"))).unwrap();
    rig.ask(Request::BeginChanges(requests::BeginChanges {})).unwrap();
    let limit = Change::Axis {
        axis: 0,
        parameter: AxisParameter::VelocityLimitRadS.number(),
        value: Some(Value::Float(5.0)),
    };
    let mut changes: Vec<Change> = change_to(named("right", "left-and-longer")).to_vec();
    changes.push(limit);
    let changes = changes.iter().cloned().collect();
    rig.ask(Request::AddChanges(requests::AddChanges { changes })).unwrap();
    let mut latched = 0;
    let words = rig.apply_and_reset_behind_each_word(|rig, cut| {
        let is_latched = match rig.ask(Request::GatewayStatus(requests::GatewayStatus {})) {
            Ok(Reply::GatewayStatus(status)) => status.e_stop_latched,
            other => panic!("{other:?}"),
        };
        latched += usize::from(is_latched);
        let now = names(rig);
        let whole = [owned(named("left", "right")), owned(named("right", "left-and-longer"))];
        assert!(
            is_latched || whole.iter().any(|whole| now == whole),
            "behind {cut} words: {now:?}"
        );
    });
    assert!(latched > words / 2, "{latched} of {}", words);
}
