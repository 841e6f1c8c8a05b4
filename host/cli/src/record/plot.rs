//! `mgw plot`: curves of chosen fields over time, as a picture.

use std::collections::BTreeMap;
use std::ops::Range;

use plotters::coord::Shift;
use plotters::prelude::*;
use serde_json::{Value, json};

use super::picture::{Format, PIXEL, has_font, not_drawn, png};
use super::play::each;
use super::read::Recorded;
use crate::args::PlotArgs;
use crate::failure::Failure;
use crate::output::Output;
use crate::states;
use crate::written;

const WIDTH: u32 = 960;
/// Of the chart of one field.
const HEIGHT: u32 = 280;
/// A curve has the least and the greatest value of so many parts of the time: no screen shows more.
const PARTS: usize = 1_200;

/// A curve: values over gateway time, s.
type Curve = Vec<(f64, f64)>;

/// What is drawn.
#[derive(Default)]
struct Curves {
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
    let format = Format::of(&output)?;
    let mut fields = arguments.fields.clone();
    fields.dedup();
    let names: Vec<&str> =
        fields.iter().filter_map(|field| states::json_names(field).first().copied()).collect();
    let mut picture = Curves::default();
    each(&arguments.part, &[], out, |message| {
        picture.take(&message, &names, &arguments.part.axes);
        Ok(())
    })?;
    if picture.curves.is_empty() {
        return Err(Failure::not_measured(format!(
            "there is nothing of {} to draw; `mgw play` shows what there is",
            names.join(", ")
        )));
    }
    let charts = picture.curves.len();
    let drawn = picture.file(&names, format).map_err(|error| not_drawn(&*error))?;
    written::write(&output, drawn, arguments.force)?;
    out.event(
        "drawn",
        format!("{charts} curves are in {}", output.display()),
        json!({ "file": output.display().to_string(), "curves": charts }),
    )
}

impl Curves {
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

    /// The bytes of the picture: a chart for each field of which there is something, one below the
    /// other.
    fn file(&self, names: &[&str], format: Format) -> Result<Vec<u8>, Box<dyn std::error::Error>> {
        has_font()?;
        let is_there = |(place, _): &(usize, &&str)| self.curves.keys().any(|(of, _)| of == place);
        let charts: Vec<(usize, &&str)> = names.iter().enumerate().filter(is_there).collect();
        let size = (WIDTH, HEIGHT * u32::try_from(charts.len())?);
        match format {
            Format::Svg => {
                let mut text = String::new();
                self.draw(SVGBackend::with_string(&mut text, size), &charts)?;
                Ok(text.into_bytes())
            }
            Format::Png => {
                let count = usize::try_from(u64::from(size.0) * u64::from(size.1))?;
                let mut pixels = vec![0; count.checked_mul(PIXEL).ok_or("it is too large")?];
                self.draw(BitMapBackend::with_buffer(&mut pixels, size), &charts)?;
                png(size.0, size.1, &pixels)
            }
        }
    }

    fn draw<B: DrawingBackend>(
        &self,
        on: B,
        charts: &[(usize, &&str)],
    ) -> Result<(), Box<dyn std::error::Error>>
    where
        B::ErrorType: 'static,
    {
        let root = on.into_drawing_area();
        root.fill(&WHITE)?;
        let times = span(self.curves.values().flatten().map(|point| point.0));
        for (area, (place, name)) in root.split_evenly((charts.len(), 1)).iter().zip(charts) {
            self.chart(area, name, *place, times.clone())?;
        }
        Ok(root.present()?)
    }

    fn chart<B: DrawingBackend>(
        &self,
        area: &DrawingArea<B, Shift>,
        name: &str,
        place: usize,
        times: Range<f64>,
    ) -> Result<(), Box<dyn std::error::Error>>
    where
        B::ErrorType: 'static,
    {
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
    use std::path::Path;

    use super::*;

    /// Two curves at 0 and at 10, and a trip in the middle of the time.
    fn two_lines() -> Curves {
        let line = |value| (0..=100).map(|at| (f64::from(at), value)).collect();
        let curves = BTreeMap::from([((0, 0), line(0.0)), ((0, 1), line(10.0))]);
        Curves { curves, trips: vec![50.0] }
    }

    /// The colours of the first two curves, of a trip, and of what there is nothing on.
    const COLOURS: [[u8; 3]; 4] = [[230, 25, 75], [60, 180, 75], [255, 0, 0], [255, 255, 255]];

    #[test]
    fn the_pixels_of_a_png_are_where_the_curves_belong() {
        let file = two_lines().file(&["velocity_rad_s"], Format::Png).unwrap();
        assert_eq!(file[..8], *b"\x89PNG\r\n\x1a\n");
        let mut reader = png::Decoder::new(std::io::Cursor::new(file)).read_info().unwrap();
        let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
        let info = reader.next_frame(&mut pixels).unwrap();
        assert_eq!((info.width, info.height, info.color_type), (960, 280, png::ColorType::Rgb));
        let at = |x: usize, y: usize| -> [u8; 3] {
            pixels[3 * (y * 960 + x)..][..3].try_into().unwrap()
        };
        let [first, second, trip, white] = COLOURS;
        let rows = |x: usize, colour| (0..280).filter(|y| at(x, *y) == colour).collect::<Vec<_>>();
        // The chart is 864 by 220 pixels with its corner at (84, 12); values from -0.5 to 10.5 lie
        // in its height, times from -5 to 105 in its width.
        let is_near = |rows: Vec<usize>, row: usize| {
            rows.len() == 1 && rows.iter().all(|of| of.abs_diff(row) <= 1)
        };
        for x in [200, 400, 700] {
            assert!(is_near(rows(x, first), 222), "{:?}", rows(x, first));
            assert!(is_near(rows(x, second), 22), "{:?}", rows(x, second));
        }
        for x in [90, 940] {
            assert!(rows(x, first).is_empty() && rows(x, second).is_empty(), "before and after");
        }
        let middle = (514..=518).map(|x| rows(x, trip).len()).max();
        assert!(middle > Some(200), "{middle:?}");
        // Its name stands on the left, the times below, each of them text.
        let dark = |xs: Range<usize>, ys: Range<usize>| {
            let all = xs.flat_map(|x| ys.clone().map(move |y| (x, y)));
            all.filter(|(x, y)| at(*x, *y).iter().all(|part| *part < 100)).count()
        };
        assert!(dark(12..40, 60..200) > 100 && dark(84..948, 236..280) > 100);
        assert_eq!(at(1, 1), white);
    }

    #[test]
    fn an_svg_has_its_text_as_text() {
        let file = two_lines().file(&["velocity_rad_s"], Format::Svg).unwrap();
        let text = String::from_utf8(file).unwrap();
        assert!(text.starts_with("<svg width=\"960\" height=\"280\""), "{}", &text[..80]);
        for part in ["velocity_rad_s", "gateway time, s", "axis 0", "axis 1", "#E6194B"] {
            assert!(text.contains(part), "{part}");
        }
    }

    #[test]
    fn other_pictures_are_refused_by_name() {
        assert_eq!(Format::of(Path::new("a/b.PNG")).unwrap(), Format::Png);
        assert_eq!(Format::of(Path::new("run.svg")).unwrap(), Format::Svg);
        for name in ["run.jpg", "run", "png", "run.png.gz"] {
            let text = Format::of(Path::new(name)).unwrap_err().to_string();
            let wanted = "pictures are SVG or PNG; name a file that ends in .svg or .png";
            assert_eq!(text, format!("{name}: {wanted}"));
        }
    }

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
