//! One declaration of every command, from which all follows that a codec knows of it.

use crate::field::FieldInfo;

/// What a request does to a motor.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Effect {
    /// It only asks: it moves nothing, stops nothing and changes nothing.
    Reads,
    /// It moves, stops or changes something, at once.
    Changes,
    /// It changes something once the motor has restarted or was switched off and on.
    Later,
}

/// Declares the commands of a protocol, in the order of its manual:
///
/// ```text
/// /// Hold a torque current.
/// TORQUE_CURRENT = 0xA1, Changes, "§2.17", "a note";
///     request(TorqueCurrent { current: Centiamps = 4 as "current_a" });
///     reply(TorqueCurrent { motion: Motion = 1 });
/// ```
///
/// The row says what the command does, its name, its code, its [`Effect`], its section and, where a
/// sender should know more, a note; then its variant of the requests and, if it is answered, that
/// of the replies.
///
/// - A value is `variable: Type = first byte as "name of its field"`. Behind may stand `in (MIN,
///   MAX)`, the counts that may be sent, or `span (MIN, MAX)`, a range that only tools are told;
///   then `if check`, a function that refuses values.
/// - A type without `as` has several fields with names of their own: `Type::FIELDS`, what a reply
///   shows as `Type::SHOWN`, `Type::build` and `Type::visit`. Where values of a variant make sense
///   only together, `via Type` behind it names the type that has these four for all of them.
/// - `[…]` behind a variant's name is its [`Layout::Fixed`](crate::Layout::Fixed).
/// - `; elsewhere` at the end: the code does not tell this variant, the codec decodes it itself.
/// - `fields(…)` instead of variants: the fields of request and reply. `shows(…)` instead of a
///   reply: its fields.
/// - `also` adds variants without a row, also such as `Variant(variable: Type = first byte)`, and
///   rows without variants.
///
/// It yields the two enums with `command`, `info`, `name` and `visit_fields`; `COMMANDS` and one
/// `CommandInfo` for each row; a module `codes`; and for the codec's own use `effect`, `effect_of`,
/// `check`, `to_payload`, `decode_row` and `build_row`.
#[macro_export]
macro_rules! commands {
    (
        $(#[$commands_doc:meta])* COMMANDS of $manual:literal;
        $(#[$request_meta:meta])* enum $Request:ident;
        $(#[$reply_meta:meta])* enum $Reply:ident;
        layout $Payload:ident, code $Code:ident;
        $(
            #[doc = $doc:literal]
            $ROW:ident = $code:expr, $effect:ident, $section:literal $(, $note:literal)?;
            $(request($($request:tt)*);)?
            $(reply($($reply:tt)*);)?
            $(shows($shown:expr);)?
            $(fields($fields:expr);)?
        )*
        also request {
            $(($($also_request:tt)*) code $request_code:expr, info $request_info:expr, effect $request_effect:expr;)*
        }
        also reply { $(($($also_reply:tt)*) code $reply_code:expr, info $reply_info:expr;)* }
        also rows { $($INFO:ident = $info:expr;)* }
    ) => {
        /// Command codes.
        pub mod codes {
            #[allow(unused_imports)]
            use super::*;

            $(
                #[doc = concat!($doc, " (", $manual, $section, ")")]
                pub const $ROW: $Code = $code;
            )*
        }

        $(
            pub(crate) const $ROW: $crate::CommandInfo = $crate::CommandInfo {
                name: $crate::__lower!($ROW),
                code: codes::$ROW as u16,
                section: concat!($manual, $section),
                request: $crate::__fields!(FIELDS $(= $fields)? $($($request)*)?),
                reply: $crate::__fields!(SHOWN $(= $fields)? $(= $shown)? $($($reply)*)?),
                note: concat!("" $(, $note)?),
            };
        )*
        $(pub(crate) const $INFO: $crate::CommandInfo = $info;)*

        $(#[$commands_doc])*
        pub const COMMANDS: &[$crate::CommandInfo] = &[$($ROW,)* $($INFO,)*];

        $crate::__enum! {
            $(#[$request_meta])* enum $Request, layout $Payload, code $Code;
            $($((
                #[doc = concat!($doc, " (", $manual, $section, ")\n\n")]
                $($request)*
            ) $ROW;)?)*
            also { $(($($also_request)*) code $request_code, info $request_info;)* }
        }

        $crate::__enum! {
            $(#[$reply_meta])* enum $Reply, layout $Payload, code $Code;
            $($((
                #[doc = concat!("Answers `", stringify!($ROW), "` (", $manual, $section, ").\n\n")]
                $($reply)*
            ) $ROW;)?)*
            also { $(($($also_reply)*) code $reply_code, info $reply_info;)* }
        }

        impl $Request {
            /// What it does to a motor.
            #[allow(unused_variables)]
            pub(crate) const fn effect(&self) -> $crate::Effect {
                match self {
                    $($($crate::__pattern!($Request, $($request)*) => $crate::Effect::$effect,)?)*
                    $($crate::__pattern!($Request, $($also_request)*) => $request_effect,)*
                }
            }

            /// What the commands with this code do; `None` of a code without a row.
            #[allow(dead_code, unreachable_patterns)]
            pub(crate) const fn effect_of(code: $Code) -> Option<$crate::Effect> {
                match code {
                    $(codes::$ROW => Some($crate::Effect::$effect),)*
                    _ => None,
                }
            }

            /// The request of a row, filled in; `None` if no row of that name can be sent.
            pub(crate) fn build_row(
                name: &str,
                fields: &$crate::Fields<'_>,
            ) -> Result<Option<$Request>, $crate::BuildError> {
                $($(if name == $ROW.name {
                    return Ok(Some($crate::__build!($Request, fields, $($request)*)));
                })?)*
                Ok(None)
            }
        }
    };
}

/// Declares a value of several fields, each with its place in the data bytes, its name and its
/// range as in [`commands!`](crate::commands).
#[macro_export]
macro_rules! fields {
    (
        $(#[$meta:meta])* struct $Group:ident, layout $Payload:ident;
        $(
            $(#[$doc:meta])*
            $f:ident: $t:ty = $at:literal as $name:literal $(in $range:tt)?;
        )*
    ) => {
        $(#[$meta])*
        pub struct $Group {
            $($(#[$doc])* pub $f: $t,)*
        }

        impl $Group {
            pub(crate) const FIELDS: &'static [$crate::FieldInfo] =
                &[$($crate::__info!($t, as $name $(in $range)?),)*];
            pub(crate) const SHOWN: &'static [$crate::FieldInfo] = $Group::FIELDS;

            #[allow(dead_code)]
            pub(crate) fn build(fields: &$crate::Fields<'_>) -> Result<$Group, $crate::BuildError> {
                Ok($Group {
                    $($f: $crate::Built::build(&const { $crate::__info!($t, as $name $(in $range)?) }, fields)?,)*
                })
            }

            pub(crate) fn visit(&self, visit: &mut $crate::Visit<'_>) {
                $($crate::__visit_field!(visit, &self.$f, $t, as $name $(in $range)?);)*
            }
        }

        impl $crate::Decode<$Payload> for $Group {
            fn get<const AT: usize>(
                data: &<$Payload as $crate::Layout>::Data,
            ) -> Result<$Group, <$Payload as $crate::Layout>::Error> {
                Ok($Group { $($f: $crate::Decode::<$Payload>::get::<$at>(data)?,)* })
            }
        }

        impl $crate::Encode<$Payload> for $Group {
            fn put<const AT: usize>(&self, data: &mut <$Payload as $crate::Layout>::Data) {
                $($crate::Encode::<$Payload>::put::<$at>(&self.$f, data);)*
            }

            fn check(&self) -> Result<(), $crate::EncodeError> {
                $($crate::__check!($Payload, $f, &self.$f, $(in $range)?);)*
                Ok(())
            }
        }
    };
}

/// One of the two enums.
#[doc(hidden)]
#[macro_export]
macro_rules! __enum {
    (
        $(#[$meta:meta])* enum $Enum:ident, layout $Payload:ident, code $Code:ident;
        $((
            $(#[$doc:meta])*
            $V:ident $([$fixed:expr])?
            $({ $(
                $(#[$field_doc:meta])*
                $f:ident: $t:ty = $at:literal
                $(as $name:literal)? $(in $range:tt)? $(span $span:tt)? $(if $check:ident)?
            ),* $(,)? })?
            $(via $via:ident)? $(; $elsewhere:ident)?
        ) $ROW:ident;)*
        also { $((
            $(#[$also_doc:meta])*
            $A:ident $([$also_fixed:expr])? $(($only:ident: $only_t:ty = $only_at:literal))?
            $({ $(
                $(#[$also_field_doc:meta])*
                $also_f:ident: $also_t:ty = $also_at:literal
                $(as $also_name:literal)? $(in $also_range:tt)? $(if $also_check:ident)?
            ),* $(,)? })?
            $(via $also_via:ident)?
        ) code $also_code:expr, info $also_info:expr;)* }
    ) => {
        $(#[$meta])*
        pub enum $Enum {
            $(
                $(#[$doc])*
                $V $({ $(
                    $(#[$field_doc])*
                    #[doc = concat!("`", stringify!($t), "`" $(, ", shown as `", $name, "`")?)]
                    $f: $t
                ),* })?,
            )*
            $($(#[$also_doc])* $A $(($only_t))? $({ $(
                $(#[$also_field_doc])*
                #[doc = concat!("`", stringify!($also_t), "`" $(, ", shown as `", $also_name, "`")?)]
                $also_f: $also_t
            ),* })?,)*
        }

        impl $Enum {
            /// The command code.
            #[allow(unused_variables)]
            pub const fn command(&self) -> $Code {
                match self {
                    $($Enum::$V { .. } => codes::$ROW,)*
                    $($Enum::$A { $(0: $only,)? $($($also_f,)*)? } => $also_code,)*
                }
            }

            /// The command in [`COMMANDS`]; `None` for what the manual does not list.
            #[allow(unused_variables)]
            pub fn info(&self) -> Option<&'static $crate::CommandInfo> {
                match self {
                    $($Enum::$V { .. } => Some(&$ROW),)*
                    $($Enum::$A { $(0: $only,)? $($($also_f,)*)? } => $also_info,)*
                }
            }

            /// The command's name in [`COMMANDS`], or `unknown`.
            pub fn name(&self) -> &'static str {
                self.info().map_or($crate::UNKNOWN, |info| info.name)
            }

            /// Hands on every field in the order of [`COMMANDS`].
            pub fn visit_fields(&self, visit: &mut $crate::Visit<'_>) {
                match self {
                    $($Enum::$V { $($($f,)*)? } => {
                        $crate::__visit!(visit, [$($via)?] $($({
                            $f, $t, $(as $name)? $(in $range)? $(span $span)?
                        })*)?);
                    })*
                    $($Enum::$A { $(0: $only,)? $($($also_f,)*)? } => {
                        $crate::__visit!(visit, [$($also_via)?] $({ $only, $only_t, })? $($({
                            $also_f, $also_t, $(as $also_name)?
                        })*)?);
                    })*
                }
            }

            /// Refuses values that must not be sent.
            pub(crate) fn check(&self) -> Result<(), $crate::EncodeError> {
                match self {
                    $($Enum::$V { $($($f,)*)? } => {
                        $($($crate::__check!($Payload, $f, $f, $(in $range)? $(if $check)?);)*)?
                    })*
                    $($Enum::$A { $(0: $only,)? $($($also_f,)*)? } => {
                        $($crate::__check!($Payload, $only, $only,);)?
                        $($($crate::__check!($Payload, $also_f, $also_f, $(in $also_range)? $(if $also_check)?);)*)?
                    })*
                }
                Ok(())
            }

            /// The data bytes, whether or not they may be sent.
            pub(crate) fn to_payload(&self) -> <$Payload as $crate::Layout>::Data {
                match self {
                    $($Enum::$V { $($($f,)*)? } => {
                        let fixed = $crate::__fixed!($($fixed)?);
                        #[allow(unused_mut)]
                        let mut data = <$Payload as $crate::Layout>::new(codes::$ROW, fixed, &[$($($at),*)?]);
                        $($($crate::Encode::<$Payload>::put::<$at>($f, &mut data);)*)?
                        data
                    })*
                    $($Enum::$A { $(0: $only,)? $($($also_f,)*)? } => {
                        let fixed = $crate::__fixed!($($also_fixed)?);
                        #[allow(unused_mut)]
                        let mut data = <$Payload as $crate::Layout>::new($also_code, fixed, &[$($($also_at),*)?]);
                        $($crate::Encode::<$Payload>::put::<$only_at>($only, &mut data);)?
                        $($($crate::Encode::<$Payload>::put::<$also_at>($also_f, &mut data);)*)?
                        data
                    })*
                }
            }

            /// What the data bytes are by their code, or else what `no_row` makes of them.
            #[allow(unreachable_patterns)]
            #[inline]
            pub(crate) fn decode_row(
                code: $Code,
                data: &<$Payload as $crate::Layout>::Data,
                no_row: impl FnOnce() -> Result<$Enum, <$Payload as $crate::Layout>::Error>,
            ) -> Result<$Enum, <$Payload as $crate::Layout>::Error> {
                match code {
                    $(codes::$ROW => $crate::__decode!(
                        $Enum, $Payload, data, no_row, ($V $([$fixed])? $({ $($f = $at),* })?) $($elsewhere)?
                    ),)*
                    _ => no_row(),
                }
            }
        }
    };
}

#[doc(hidden)]
#[macro_export]
macro_rules! __decode {
    (
        $Enum:ident, $Payload:ident, $data:ident, $no_row:ident,
        ($V:ident $([$fixed:expr])? $({ $($f:ident = $at:literal),* })?)
    ) => {{
        <$Payload as $crate::Layout>::expect($data, $crate::__fixed!($($fixed)?), &[$($($at),*)?])?;
        Ok($Enum::$V { $($($f: $crate::Decode::<$Payload>::get::<$at>($data)?,)*)? })
    }};
    ($Enum:ident, $Payload:ident, $data:ident, $no_row:ident, $variant:tt elsewhere) => {
        $no_row()
    };
}

#[doc(hidden)]
#[macro_export]
macro_rules! __fixed {
    () => {
        Default::default()
    };
    ($fixed:expr) => {
        $fixed
    };
}

/// A variant as a pattern that binds its values.
#[doc(hidden)]
#[macro_export]
macro_rules! __pattern {
    (
        $Enum:ident, $(#[$doc:meta])* $V:ident $([$($fixed:tt)*])?
        $({ $($(#[$field_doc:meta])* $f:ident: $t:ty = $at:literal
            $(as $name:literal)? $(in $range:tt)? $(span $span:tt)? $(if $check:ident)?
        ),* $(,)? })? $(via $via:ident)? $(; $elsewhere:ident)?
    ) => {
        $Enum::$V { $($($f,)*)? }
    };
}

/// A variant, its values built from what a caller gives.
#[doc(hidden)]
#[macro_export]
macro_rules! __build {
    (
        $Enum:ident, $fields:ident, $(#[$doc:meta])* $V:ident $([$($fixed:tt)*])?
        $({ $($(#[$field_doc:meta])* $f:ident: $t:ty = $at:literal
            $(as $name:literal)? $(in $range:tt)? $(span $span:tt)? $(if $check:ident)?
        ),* $(,)? })? $(; $elsewhere:ident)?
    ) => {
        $Enum::$V {
            $($($f: $crate::__build_field!($fields, $t, $(as $name)? $(in $range)? $(span $span)?)?,)*)?
        }
    };
    (
        $Enum:ident, $fields:ident, $(#[$doc:meta])* $V:ident
        { $($(#[$field_doc:meta])* $f:ident: $t:ty = $at:literal $(if $check:ident)?),* $(,)? } via $via:ident $(; $elsewhere:ident)?
    ) => {{
        let ($($f,)*) = $via::build($fields)?;
        $Enum::$V { $($f,)* }
    }};
}

#[doc(hidden)]
#[macro_export]
macro_rules! __build_field {
    ($fields:ident, $t:ty, as $($name:tt)*) => {
        <$t as $crate::Built>::build(&const { $crate::__info!($t, as $($name)*) }, $fields)
    };
    ($fields:ident, $t:ty,) => {
        <$t>::build($fields)
    };
}

/// The fields of a variant: what builds it (`FIELDS`), or what shows it (`SHOWN`).
#[doc(hidden)]
#[macro_export]
macro_rules! __fields {
    ($which:ident) => { &[] };
    ($which:ident = $fields:expr) => { $fields };
    (
        $which:ident $(#[$doc:meta])* $V:ident $([$($fixed:tt)*])?
        $({ $($(#[$field_doc:meta])* $f:ident: $t:ty = $at:literal
            $(as $name:literal)? $(in $range:tt)? $(span $span:tt)? $(if $check:ident)?
        ),* $(,)? })? $(; $elsewhere:ident)?
    ) => {{
        const PARTS: &[&[$crate::FieldInfo]] =
            &[$($($crate::__field!($which, $t, $(as $name)? $(in $range)? $(span $span)?),)*)?];
        const ALL: [$crate::FieldInfo; $crate::count(PARTS)] = $crate::joined(PARTS);
        &ALL
    }};
    (
        $which:ident $(#[$doc:meta])* $V:ident
        { $($(#[$field_doc:meta])* $f:ident: $t:ty = $at:literal $(if $check:ident)?),* $(,)? } via $via:ident $(; $elsewhere:ident)?
    ) => {
        $via::$which
    };
}

#[doc(hidden)]
#[macro_export]
macro_rules! __field {
    ($which:ident, $t:ty, as $($name:tt)*) => {
        &[$crate::__info!($t, as $($name)*)]
    };
    ($which:ident, $t:ty,) => {
        <$t>::$which
    };
}

/// One field under its name.
#[doc(hidden)]
#[macro_export]
macro_rules! __info {
    ($t:ty, as $name:literal $($($word:ident)? ($min:expr, $max:expr))?) => {
        <$t as $crate::Shown>::INFO.named($name)$(.within($min as i64, $max as i64))?
    };
}

#[doc(hidden)]
#[macro_export]
macro_rules! __visit {
    ($visit:ident, [] $({ $f:ident, $($field:tt)* })*) => {
        $($crate::__visit_field!($visit, $f, $($field)*);)*
    };
    ($visit:ident, [$via:ident] $({ $f:ident, $t:ty, })*) => {
        $via::visit($visit, $(*$f),*)
    };
}

#[doc(hidden)]
#[macro_export]
macro_rules! __visit_field {
    ($visit:ident, $value:expr, $t:ty, as $($name:tt)*) => {
        $crate::Shown::visit($value, &const { $crate::__info!($t, as $($name)*) }, $visit)
    };
    ($visit:ident, $value:expr, $t:ty,) => {
        $value.visit($visit)
    };
}

#[doc(hidden)]
#[macro_export]
macro_rules! __check {
    ($Payload:ident, $f:ident, $value:expr, $(in ($min:expr, $max:expr))? $(if $check:ident)?) => {
        $($check(*$value)?;)?
        $($crate::check_number(stringify!($f), *$value, $min as i64, $max as i64)?;)?
        $crate::Encode::<$Payload>::check($value)?
    };
}

/// How many fields these are.
#[doc(hidden)]
pub const fn count(parts: &[&[FieldInfo]]) -> usize {
    let (mut count, mut part) = (0, 0);
    while part < parts.len() {
        count += parts[part].len();
        part += 1;
    }
    count
}

/// These fields in a row.
#[doc(hidden)]
pub const fn joined<const N: usize>(parts: &[&[FieldInfo]]) -> [FieldInfo; N] {
    let mut all = [FieldInfo::boolean(""); N];
    let (mut place, mut part) = (0, 0);
    while part < parts.len() {
        let mut field = 0;
        while field < parts[part].len() {
            all[place] = parts[part][field];
            (place, field) = (place + 1, field + 1);
        }
        part += 1;
    }
    all
}

/// The name of a constant in lower case.
#[doc(hidden)]
pub const fn snake_case<const N: usize>(name: &str) -> [u8; N] {
    let mut lower = [0; N];
    let mut place = 0;
    while place < N {
        lower[place] = name.as_bytes()[place].to_ascii_lowercase();
        place += 1;
    }
    lower
}

/// ASCII letters as text.
#[doc(hidden)]
pub const fn ascii(bytes: &[u8]) -> &str {
    match core::str::from_utf8(bytes) {
        Ok(text) => text,
        Err(_) => "",
    }
}
