//! What follows from what was seen: one file for each side of it.

mod arming;
mod bystanders;
mod configured;
mod counts;
mod delivery;
mod due;
mod events;
mod frames;
mod grants;
mod history;
mod hosts;
mod motors;
mod results;
mod starts;
mod stored;
mod together;
mod unsent;

pub(crate) use arming::Arming;
pub(crate) use history::History;
pub(crate) use starts::Unlisted;
pub(crate) use stored::Stored;
pub(crate) use together::Started;
