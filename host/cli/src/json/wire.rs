//! Any message of the wire as JSON: its fields as they are called there, its variants in
//! snake_case.

use serde::ser::{
    Error as _, Impossible, Serialize, SerializeSeq, SerializeStruct, SerializeStructVariant,
    SerializeTuple, SerializeTupleStruct, SerializeTupleVariant, Serializer,
};
use serde_json::{Error, Map, Value};

use super::snake;
use crate::output::number;

/// The message. What JSON has no number for is null.
pub fn wire(value: &impl Serialize) -> Value {
    value.serialize(Wire).unwrap_or(Value::Null)
}

struct Wire;

/// What consists of several values, and the variant that they belong to.
struct Parts<T> {
    variant: Option<String>,
    parts: T,
}

fn of_variant(variant: Option<String>, value: Value) -> Value {
    match variant {
        None => value,
        Some(variant) => Value::Object(Map::from_iter([(variant, value)])),
    }
}

impl Parts<Vec<Value>> {
    fn list(variant: Option<&str>) -> Self {
        Self { variant: variant.map(snake), parts: Vec::new() }
    }

    fn add(&mut self, value: &(impl Serialize + ?Sized)) -> Result<(), Error> {
        self.parts.push(value.serialize(Wire)?);
        Ok(())
    }

    fn whole(self) -> Result<Value, Error> {
        Ok(of_variant(self.variant, Value::Array(self.parts)))
    }
}

impl Parts<Map<String, Value>> {
    fn fields(variant: Option<&str>) -> Self {
        Self { variant: variant.map(snake), parts: Map::new() }
    }

    fn add(&mut self, key: &str, value: &(impl Serialize + ?Sized)) -> Result<(), Error> {
        self.parts.insert(key.to_owned(), value.serialize(Wire)?);
        Ok(())
    }

    fn whole(self) -> Result<Value, Error> {
        Ok(of_variant(self.variant, Value::Object(self.parts)))
    }
}

macro_rules! plain {
    ($($method:ident: $type:ty),+) => {
        $(fn $method(self, value: $type) -> Result<Value, Error> { Ok(Value::from(value)) })+
    };
}

impl Serializer for Wire {
    type Ok = Value;
    type Error = Error;
    type SerializeSeq = Parts<Vec<Value>>;
    type SerializeTuple = Parts<Vec<Value>>;
    type SerializeTupleStruct = Parts<Vec<Value>>;
    type SerializeTupleVariant = Parts<Vec<Value>>;
    type SerializeMap = Impossible<Value, Error>;
    type SerializeStruct = Parts<Map<String, Value>>;
    type SerializeStructVariant = Parts<Map<String, Value>>;

    plain! {
        serialize_bool: bool, serialize_i8: i8, serialize_i16: i16, serialize_i32: i32,
        serialize_i64: i64, serialize_u8: u8, serialize_u16: u16, serialize_u32: u32,
        serialize_u64: u64, serialize_f64: f64, serialize_str: &str, serialize_bytes: &[u8]
    }

    fn serialize_f32(self, value: f32) -> Result<Value, Error> {
        Ok(number(value))
    }

    fn serialize_char(self, value: char) -> Result<Value, Error> {
        Ok(value.to_string().into())
    }

    fn serialize_none(self) -> Result<Value, Error> {
        Ok(Value::Null)
    }

    fn serialize_some<T: Serialize + ?Sized>(self, value: &T) -> Result<Value, Error> {
        value.serialize(self)
    }

    fn serialize_unit(self) -> Result<Value, Error> {
        Ok(Value::Null)
    }

    fn serialize_unit_struct(self, _: &'static str) -> Result<Value, Error> {
        Ok(Value::Null)
    }

    fn serialize_unit_variant(
        self,
        _: &'static str,
        _: u32,
        variant: &'static str,
    ) -> Result<Value, Error> {
        Ok(snake(variant).into())
    }

    fn serialize_newtype_struct<T: Serialize + ?Sized>(
        self,
        _: &'static str,
        value: &T,
    ) -> Result<Value, Error> {
        value.serialize(self)
    }

    fn serialize_newtype_variant<T: Serialize + ?Sized>(
        self,
        _: &'static str,
        _: u32,
        variant: &'static str,
        value: &T,
    ) -> Result<Value, Error> {
        Ok(of_variant(Some(snake(variant)), value.serialize(self)?))
    }

    fn serialize_seq(self, _: Option<usize>) -> Result<Self::SerializeSeq, Error> {
        Ok(Parts::list(None))
    }

    fn serialize_tuple(self, _: usize) -> Result<Self::SerializeTuple, Error> {
        Ok(Parts::list(None))
    }

    fn serialize_tuple_struct(
        self,
        _: &'static str,
        _: usize,
    ) -> Result<Self::SerializeTupleStruct, Error> {
        Ok(Parts::list(None))
    }

    fn serialize_tuple_variant(
        self,
        _: &'static str,
        _: u32,
        variant: &'static str,
        _: usize,
    ) -> Result<Self::SerializeTupleVariant, Error> {
        Ok(Parts::list(Some(variant)))
    }

    fn serialize_map(self, _: Option<usize>) -> Result<Self::SerializeMap, Error> {
        Err(Error::custom("no message of the wire has a map"))
    }

    fn serialize_struct(self, _: &'static str, _: usize) -> Result<Self::SerializeStruct, Error> {
        Ok(Parts::fields(None))
    }

    fn serialize_struct_variant(
        self,
        _: &'static str,
        _: u32,
        variant: &'static str,
        _: usize,
    ) -> Result<Self::SerializeStructVariant, Error> {
        Ok(Parts::fields(Some(variant)))
    }
}

macro_rules! lists {
    ($($trait:ident $method:ident),+) => {
        $(impl $trait for Parts<Vec<Value>> {
            type Ok = Value;
            type Error = Error;

            fn $method<T: Serialize + ?Sized>(&mut self, value: &T) -> Result<(), Error> {
                self.add(value)
            }

            fn end(self) -> Result<Value, Error> {
                self.whole()
            }
        })+
    };
}

lists! {
    SerializeSeq serialize_element, SerializeTuple serialize_element,
    SerializeTupleStruct serialize_field, SerializeTupleVariant serialize_field
}

macro_rules! fields {
    ($($trait:ident),+) => {
        $(impl $trait for Parts<Map<String, Value>> {
            type Ok = Value;
            type Error = Error;

            fn serialize_field<T: Serialize + ?Sized>(
                &mut self,
                key: &'static str,
                value: &T,
            ) -> Result<(), Error> {
                self.add(key, value)
            }

            fn end(self) -> Result<Value, Error> {
                self.whole()
            }
        })+
    };
}

fields! { SerializeStruct, SerializeStructVariant }

#[cfg(test)]
mod tests {
    use host_protocol::requests as ask;
    use host_protocol::{Request, Setpoint, StopTarget};

    use super::*;

    #[test]
    fn variants_are_in_snake_case_and_fields_as_they_are() {
        let stop = Request::Stop(ask::Stop { target: StopTarget::All });
        assert_eq!(wire(&stop).to_string(), r#"{"stop":{"target":"all"}}"#);
        let setpoint = Setpoint::Velocity { velocity_rad_s: 0.1 };
        assert_eq!(wire(&setpoint).to_string(), r#"{"velocity":{"velocity_rad_s":0.1}}"#);
    }
}
