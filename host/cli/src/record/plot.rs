//! `mgw plot`: curves of chosen fields over time, as SVG.

use std::collections::BTreeMap;
use std::fs::OpenOptions;
use std::io::Write;
use std::ops::Range;
use std::path::Path;

use plotters::coord::Shift;
use plotters::prelude::*;
use serde_json::{Value, json};

use super::play::{each, wanted};
use super::read::Recorded;
use crate::args::PlotArgs;
use crate::failure::Failure;
use crate::output::Output;
use crate::states;

const WIDTH: u32 = 960;
/// Of the chart of one field.
const HEIGHT: u32 = 280;
/// A curve has the least and the greatest value of so many parts of the time: no screen shows more.
const PARTS: usize = 1_200;

/// A curve: values over gateway time, s.
type Curve = Vec<(f64, f64)>;

/// What is drawn.
#[derive(Default)]
struct Picture {
    /// By field and axis.
    curves: BTreeMap<(usize, u64), Curve>,
    /// When axes tripped.
    trips: Vec<f64>,
}

/// Draws.
pub fn run(arguments: &PlotArgs, out: Output) -> Result<(), Failure> {
    let output = match &arguments.output {
        Some(output) => output.clone(),
        None => {
            arguments.part.files.first().map(|file| file.with_extension("svg")).unwrap_or_default()
        }
    };
    if output.extension().is_some_and(|extension| !extension.eq_ignore_ascii_case("svg")) {
        return Err(Failure::Usage(format!(
            "{}: pictures are SVG, which every browser shows; name a file that ends in .svg",
            output.display()
        )));
    }
    let mut fields = arguments.fields.clone();
    fields.dedup();
    let names: Vec<&str> =
        fields.iter().filter_map(|field| states::json_names(field).first().copied()).collect();
    let wanted = wanted(&arguments.part, &[]);
    let mut picture = Picture::default();
    each(&arguments.part.files, &wanted, out, |message| {
        picture.take(&message, &names, &arguments.part.axes);
        Ok(())
    })?;
    if picture.curves.is_empty() {
        return Err(Failure::NotMeasured {
            text: format!(
                "there is nothing of {} to draw; `mgw play` shows what there is",
                names.join(", ")
            ),
        });
    }
    let charts = picture.curves.len();
    let svg = picture.svg(&names).map_err(|error| Failure::NotMeasured {
        text: format!("the picture cannot be drawn ({error})"),
    })?;
    write(&output, &svg, arguments.force)?;
    out.event(
        "drawn",
        format!("{charts} curves are in {}", output.display()),
        json!({ "file": output.display().to_string(), "curves": charts }),
    )
}

fn write(path: &Path, text: &str, force: bool) -> Result<(), Failure> {
    let mut options = OpenOptions::new();
    let options = options.write(true).create(force).truncate(force).create_new(!force);
    let written = options.open(path).and_then(|mut file| file.write_all(text.as_bytes()));
    written.map_err(|source| Failure::Unwritten { path: path.display().to_string(), source })
}

impl Picture {
    fn take(&mut self, message: &Recorded, names: &[&str], axes: &[u8]) {
        let (Some(time), value) = (message.time_s(), &message.value) else { return };
        if value["event"] == "tripped" {
            self.trips.push(time);
        }
        let all = match value["event"].as_str() {
            Some("sample") => std::slice::from_ref(value),
            Some("period") => value["axes"].as_array().map_or(&[][..], Vec::as_slice),
            _ => return,
        };
        for one in all {
            let Some(axis) = one["axis"].as_u64() else { continue };
            if !axes.is_empty() && !axes.iter().any(|wanted| u64::from(*wanted) == axis) {
                continue;
            }
            for (place, name) in names.iter().enumerate() {
                if let Some(number) = number(&one[*name]) {
                    self.curves.entry((place, axis)).or_default().push((time, number));
                }
            }
        }
    }

    fn svg(&self, names: &[&str]) -> Result<String, Box<dyn std::error::Error>> {
        let mut text = String::new();
        let charts: Vec<usize> = (0..names.len())
            .filter(|place| self.curves.keys().any(|(of, _)| of == place))
            .collect();
        let height = HEIGHT * u32::try_from(charts.len())?;
        let root = SVGBackend::with_string(&mut text, (WIDTH, height)).into_drawing_area();
        root.fill(&WHITE)?;
        let span = span(self.curves.values().flatten().map(|point| point.0));
        for (area, place) in root.split_evenly((charts.len(), 1)).iter().zip(charts) {
            self.chart(area, names[place], place, span.clone())?;
        }
        root.present()?;
        drop(root);
        Ok(text)
    }

    fn chart(
        &self,
        area: &DrawingArea<SVGBackend<'_>, Shift>,
        name: &str,
        place: usize,
        times: Range<f64>,
    ) -> Result<(), Box<dyn std::error::Error>> {
        let curves: Vec<(u64, &Curve)> = self
            .curves
            .iter()
            .filter(|((of, _), _)| *of == place)
            .map(|((_, axis), curve)| (*axis, curve))
            .collect();
        let values = span(curves.iter().flat_map(|(_, curve)| curve.iter().map(|point| point.1)));
        let mut chart = ChartBuilder::on(area)
            .margin(12)
            .x_label_area_size(36)
            .y_label_area_size(72)
            .build_cartesian_2d(times.clone(), values.clone())?;
        chart.configure_mesh().x_desc("gateway time, s").y_desc(name).draw()?;
        for (number, (axis, curve)) in curves.iter().enumerate() {
            let colour = Palette99::pick(number).to_rgba();
            chart
                .draw_series(LineSeries::new(thinned(curve, &times), colour.stroke_width(1)))?
                .label(format!("axis {axis}"))
                .legend(move |(x, y)| PathElement::new([(x, y), (x + 16, y)], colour));
        }
        for trip in self.trips.iter().filter(|trip| times.contains(trip)) {
            let line = [(*trip, values.start), (*trip, values.end)];
            chart.draw_series([PathElement::new(line, RED.stroke_width(2))])?;
        }
        chart.configure_series_labels().background_style(WHITE).border_style(BLACK).draw()?;
        Ok(())
    }
}

/// A reading, or a number that is one by itself.
fn number(value: &Value) -> Option<f64> {
    value.as_f64().or_else(|| value["value"].as_f64())
}

/// From the least to the greatest, and never nothing.
fn span(values: impl Iterator<Item = f64>) -> Range<f64> {
    let (least, most) = values
        .fold((f64::MAX, f64::MIN), |(least, most), value| (least.min(value), most.max(value)));
    let room = if most > least { (most - least) * 0.05 } else { 0.5 };
    least - room..most + room
}

/// The least and the greatest value of each part of the time, in order.
fn thinned(curve: &Curve, times: &Range<f64>) -> Curve {
    if curve.len() <= 2 * PARTS {
        return curve.clone();
    }
    #[expect(clippy::cast_precision_loss, reason = "a small number")]
    let part = (times.end - times.start) / PARTS as f64;
    let mut thinned: Curve = Vec::new();
    let mut rest = curve.as_slice();
    while let Some(first) = rest.first() {
        let count = rest.iter().take_while(|point| point.0 < first.0 + part).count().max(1);
        let (these, others) = rest.split_at(count);
        rest = others;
        let least = these.iter().copied().min_by(|a, b| a.1.total_cmp(&b.1));
        let most = these.iter().copied().max_by(|a, b| a.1.total_cmp(&b.1));
        let mut both: Curve = least.into_iter().chain(most).collect();
        both.sort_by(|a, b| a.0.total_cmp(&b.0));
        both.dedup();
        thinned.extend(both);
    }
    thinned
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_long_curve_keeps_its_peaks() {
        let mut curve: Curve = (0..100_000).map(|at| (f64::from(at), 0.0)).collect();
        curve[54_321].1 = 7.0;
        curve[54_322].1 = -3.0;
        let thinned = thinned(&curve, &(0.0..100_000.0));
        assert!(thinned.len() <= 2 * PARTS + 2, "{}", thinned.len());
        let peaks: Vec<_> = thinned.iter().filter(|point| point.1 != 0.0).copied().collect();
        assert_eq!(peaks, [(54_321.0, 7.0), (54_322.0, -3.0)]);
        assert!(thinned.is_sorted_by(|a, b| a.0 <= b.0));
    }
}
