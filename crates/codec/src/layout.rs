//! How values stand in the data bytes of one protocol.

use crate::error::EncodeError;

/// How the data bytes of one protocol's frames are laid out.
pub trait Layout {
    /// The data bytes.
    type Data;
    /// A command code.
    type Code;
    /// What a command has besides its code and its values: fixed bytes, or how many bytes there
    /// are.
    type Fixed: Default;
    /// Why bytes cannot be decoded.
    type Error;

    /// The bytes of a command whose values, yet to be put in, begin at these places.
    fn new(code: Self::Code, fixed: Self::Fixed, places: &[usize]) -> Self::Data;

    /// Whether everything but the values at these places is as the manual prints it.
    fn expect(data: &Self::Data, fixed: Self::Fixed, places: &[usize]) -> Result<(), Self::Error>;
}

/// A value that commands carry in the layout `L`, from byte `AT` on.
#[diagnostic::on_unimplemented(message = "nothing puts `{Self}` into the bytes of this protocol")]
pub trait Encode<L: Layout> {
    /// Puts the value into the bytes, whether or not it may be sent.
    fn put<const AT: usize>(&self, data: &mut L::Data);

    /// Refuses a value that must not be sent.
    fn check(&self) -> Result<(), EncodeError> {
        Ok(())
    }
}

/// A value that commands told by their code carry in the layout `L`, from byte `AT` on.
#[diagnostic::on_unimplemented(
    message = "nothing takes `{Self}` out of the bytes of this protocol"
)]
pub trait Decode<L: Layout>: Sized {
    /// Takes the value out of the bytes, whether or not it may be sent.
    fn get<const AT: usize>(data: &L::Data) -> Result<Self, L::Error>;
}
