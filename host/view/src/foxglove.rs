//! The server's half of Foxglove's WebSocket protocol, as far as channels that are read need it:
//! <https://github.com/foxglove/ws-protocol/blob/main/docs/spec.md>. Pure: no socket.

use std::collections::BTreeMap;

use serde_json::{Value, json};
use tungstenite::Message;

/// The binary message that carries data.
const MESSAGE_DATA: u8 = 1;
/// Subscriptions of one visitor.
const SUBSCRIPTIONS: usize = 1_024;
/// The level of a status that tells of an error.
const ERROR: u8 = 2;

/// What can be subscribed to.
#[derive(Debug, Clone, PartialEq)]
pub struct Channel {
    /// Its number.
    pub id: u32,
    /// Its name.
    pub topic: String,
    /// The name of its schema.
    pub schema_name: &'static str,
    /// Its schema, a JSON schema.
    pub schema: Value,
}

/// What a visitor has subscribed to.
#[derive(Debug, Clone, Default)]
pub struct Session {
    /// The channel of each subscription.
    subscriptions: BTreeMap<u32, u32>,
}

/// What is said first.
pub fn server_info(name: &str, session: &str) -> Value {
    json!({
        "op": "serverInfo", "name": name, "capabilities": [], "sessionId": session,
        "metadata": {},
    })
}

/// What there is.
pub fn advertise(channels: &[Channel]) -> Value {
    let channel = |channel: &Channel| {
        json!({
            "id": channel.id, "topic": channel.topic, "encoding": "json",
            "schemaName": channel.schema_name, "schemaEncoding": "jsonschema",
            "schema": channel.schema.to_string(),
        })
    };
    json!({ "op": "advertise", "channels": channels.iter().map(channel).collect::<Value>() })
}

/// What is not there any more.
pub fn unadvertise(channels: &[Channel]) -> Value {
    let ids: Vec<u32> = channels.iter().map(|channel| channel.id).collect();
    json!({ "op": "unadvertise", "channelIds": ids })
}

/// An error, for people.
pub fn error(text: &str) -> Value {
    json!({ "op": "status", "level": ERROR, "message": text })
}

impl Session {
    /// What the visitor says.
    ///
    /// # Errors
    /// What is wrong with it, to be told as an [`error`].
    pub fn take(&mut self, text: &str) -> Result<(), String> {
        let said: Value =
            serde_json::from_str(text).map_err(|error| format!("no JSON: {error}"))?;
        let number = |value: &Value| value.as_u64().and_then(|of| u32::try_from(of).ok());
        match said["op"].as_str() {
            Some("subscribe") => {
                for one in said["subscriptions"].as_array().into_iter().flatten() {
                    let (Some(id), Some(channel)) = (number(&one["id"]), number(&one["channelId"]))
                    else {
                        return Err("a subscription has an id and a channelId".to_owned());
                    };
                    if self.subscriptions.len() >= SUBSCRIPTIONS {
                        return Err(format!("{SUBSCRIPTIONS} subscriptions at most"));
                    }
                    self.subscriptions.insert(id, channel);
                }
                Ok(())
            }
            Some("unsubscribe") => {
                for id in said["subscriptionIds"].as_array().into_iter().flatten() {
                    number(id).and_then(|id| self.subscriptions.remove(&id));
                }
                Ok(())
            }
            Some(other) => Err(format!(
                "{other:?} is not offered: this server is read by subscribe and unsubscribe, \
                 and commanded by its own page only"
            )),
            None => Err("a message has an op".to_owned()),
        }
    }

    /// The subscriptions of a channel.
    pub fn of(&self, channel: u32) -> impl Iterator<Item = u32> {
        self.subscriptions.iter().filter(move |(_, of)| **of == channel).map(|(id, _)| *id)
    }
}

/// A message of a channel for one subscription. `time_ns`: since 1970, or since the gateway's
/// start.
pub fn data(subscription: u32, time_ns: u64, payload: &[u8]) -> Message {
    let mut bytes = vec![MESSAGE_DATA];
    bytes.extend(subscription.to_le_bytes());
    bytes.extend(time_ns.to_le_bytes());
    bytes.extend(payload);
    Message::binary(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn data_is_as_the_specification_says() {
        let message = data(0x0102_0304, 5, b"{}");
        let wanted = [1, 4, 3, 2, 1, 5, 0, 0, 0, 0, 0, 0, 0, b'{', b'}'];
        assert_eq!(message.into_data().as_ref(), wanted);
    }

    #[test]
    fn subscriptions_come_and_go() {
        let mut session = Session::default();
        let subscribe = r#"{"op":"subscribe","subscriptions":[{"id":7,"channelId":1},
            {"id":8,"channelId":1},{"id":9,"channelId":2}]}"#;
        session.take(subscribe).unwrap();
        assert_eq!(session.of(1).collect::<Vec<_>>(), [7, 8]);
        session.take(r#"{"op":"unsubscribe","subscriptionIds":[7]}"#).unwrap();
        assert_eq!(session.of(1).collect::<Vec<_>>(), [8]);
    }

    #[test]
    fn nothing_is_commanded_by_this_protocol() {
        let mut session = Session::default();
        for said in [
            r#"{"op":"advertise","channels":[]}"#,
            r#"{"op":"setParameters","parameters":[]}"#,
            "{}",
            "x",
            r#"{"op":"subscribe","subscriptions":[{"id":-1,"channelId":1}]}"#,
        ] {
            assert!(session.take(said).is_err(), "{said}");
        }
        assert!(session.of(1).next().is_none());
    }
}
