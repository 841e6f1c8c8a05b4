//! The documentation of fields that several messages have.

/// Makes `field_doc!`, which gives the documentation of a field by its name, or nothing where the
/// message documents it itself.
macro_rules! field_docs {
    ($dollar:tt $($name:ident $text:literal;)+) => {
        macro_rules! field_doc {
            ($dollar field:ident $dollar(#[$dollar doc:meta])+) => { "" };
            $(($name) => { $text };)+
        }
        pub(crate) use field_doc;
    };
}

field_docs! { $
    available_permille "What is available, 1/1000 of the bitrate.";
    agreement "How its answers agree.";
    axis "Number of the axis, from 0.";
    baud "The rate that was asked for.";
    bitrate "bit/s.";
    by "Who has the name.";
    bus "Number of the bus, from 0.";
    buses "Buses are numbered from 0 to one less than this.";
    command "First byte of the command; 0 is motion mode.";
    current "The epoch of the axis, if it is armed.";
    epoch "The epoch that [`Arm`](crate::requests::Arm) returned.";
    expires_at_us "Low 32 bits of the gateway time at which the setpoint expires, µs; later than \
        now by at most the TTL of the axis.";
    faults "The motor's own fault word, where it could be read.";
    gateway_major "What the gateway speaks.";
    hint "What may be behind it.";
    holder "The host link that has it.";
    host_major "What the host speaks.";
    id "The CAN id.";
    kind "What it is.";
    least_ms "What is long enough, ms.";
    length "Bytes of the part.";
    max "The largest allowed.";
    max_axes "Axes are numbered from 0 to one less than this.";
    min "The smallest allowed.";
    missing "Bytes of it that are missing.";
    most "As many fit.";
    motor_timeout_ms "After how many ms the motor stops by itself.";
    needed_permille "What is needed, 1/1000 of the bitrate.";
    name "Its name.";
    next "The first byte that is missing.";
    node "The node of its motor.";
    now_us "Low 32 bits of the gateway time, µs.";
    number "Its number.";
    of "Whose name it is.";
    offered "What could be had there instead, bit/s; 0 behind the last one.";
    other "The axis whose motor uses it.";
    parameter "Number of the parameter.";
    parts "How many parts there are.";
    possible "The dialects that its answers allow: bit n is number n.";
    protocol "The protocol of the motor.";
    quantity "Which value.";
    reason "Why.";
    room "Bytes of the longest image.";
    running "The version that runs.";
    stated "The dialect of the axis, by its number in `rmd_dialect`.";
    state "The state of the axis.";
    value "What it is, in its own unit.";
    velocity_rad_s "rad/s, positive is counter-clockwise.";
}
