//! `mgw axes`

use host_protocol::{AxisSummary, parameters};
use serde_json::json;

use crate::failure::Failure;
use crate::json;
use crate::session::Session;
use crate::states::{axis_cells, axis_headings};
use crate::table::Table;
use crate::words::{self, or_nothing};

/// Lists the axes that have at least one parameter.
pub fn run(session: &mut Session) -> Result<(), Failure> {
    let axes = session.client.list_axes()?;
    let names = session.known_names();
    let object = |axis: &AxisSummary| {
        json::with_name(json::axis::summary(axis, missing(axis)), names.axis(axis.axis))
    };
    session.out.object(&json!({ "axes": axes.iter().map(object).collect::<Vec<_>>() }))?;
    if axes.is_empty() {
        return session.out.text(
            "no axis is configured. Start with `mgw config bus 0 bitrate=1000000 protocols=rmd` and \
                `mgw config axis 0 bus=0 protocol=rmd node=1 stop_action=hold`, or with a file",
        );
    }
    let headings = [">bus", "protocol", ">node", "state", "missing"];
    let headings = axis_headings(&names).into_iter().chain(headings);
    let mut table = Table::new(&headings.collect::<Vec<_>>());
    for axis in &axes {
        table.row(axis_cells(axis.axis, &names).into_iter().chain([
            or_nothing(axis.bus),
            or_nothing(axis.protocol),
            or_nothing(axis.node),
            words::axis_state(axis.state).to_owned(),
            missing(axis).unwrap_or_default().to_owned(),
        ]));
    }
    session.out.table(&table)
}

fn missing(axis: &AxisSummary) -> Option<&'static str> {
    axis.missing.map(|number| {
        parameters::name(number).unwrap_or("a parameter that this program does not know")
    })
}
