//! The cycle rates as a picture.

use plotters::prelude::*;

use super::Cycles;
use crate::failure::Failure;
use crate::record::{has_font, not_drawn};

const SIZE: (u32, u32) = (720, 440);

/// Rates over the number of axes, measured and planned, as SVG.
pub fn svg(cycles: &[Cycles]) -> Result<String, Failure> {
    let mut text = String::new();
    draw(cycles, &mut text).map_err(|error| not_drawn(&*error))?;
    Ok(text)
}

#[expect(clippy::cast_precision_loss, reason = "at most 16 axes")]
fn draw(cycles: &[Cycles], text: &mut String) -> Result<(), Box<dyn std::error::Error>> {
    let measured: Vec<(f64, f64)> =
        cycles.iter().map(|of| (of.axes.len() as f64, of.spread.rate())).collect();
    let planned: Vec<(f64, f64)> =
        cycles.iter().filter_map(|of| Some((of.axes.len() as f64, of.plan.rate()?))).collect();
    let most =
        |of: fn(&(f64, f64)) -> f64| measured.iter().chain(&planned).map(of).fold(1.0, f64::max);
    has_font()?;
    let root = SVGBackend::with_string(text, SIZE).into_drawing_area();
    root.fill(&WHITE)?;
    let mut chart = ChartBuilder::on(&root)
        .caption("Cycle rate", ("sans-serif", 22))
        .margin(16)
        .x_label_area_size(44)
        .y_label_area_size(64)
        .build_cartesian_2d(0.0..most(|at| at.0) + 1.0, 0.0..most(|at| at.1) * 1.1)?;
    chart.configure_mesh().x_desc("axes").y_desc("Hz").draw()?;
    for (name, points, colour) in [("measured", measured, BLUE), ("planned", planned, RED)] {
        chart
            .draw_series(LineSeries::new(points.iter().copied(), colour.stroke_width(2)))?
            .label(name)
            .legend(move |(x, y)| PathElement::new([(x, y), (x + 20, y)], colour));
        chart.draw_series(points.iter().map(|at| Circle::new(*at, 4, colour.filled())))?;
    }
    chart.configure_series_labels().background_style(WHITE).border_style(BLACK).draw()?;
    root.present()?;
    Ok(())
}
