//! The figures that pilots report, over time: a small plot for each.

use super::samples::{OwnBand, Samples};
use super::series::Series;
use super::style::{BLUE, EDGE, GRID, INK, WIDTH, number, pixels, px, text};
use crate::error::DrawError;
use crate::number_text::on_axis;
use crate::tuning::OWN_PANELS_MAX;
use plotters::prelude::*;

/// Height of the title.
const TITLE: u32 = px(58);
/// Height of a panel with its name and its numbers.
const PANEL: u32 = px(210);
/// Height of a panel's name.
const NAME: u32 = px(30);
/// Space for the numbers left of a panel.
const LEFT: u32 = px(66);
/// Space for the numbers below a panel.
const BELOW: u32 = px(26);

type Area<'a> = DrawingArea<SVGBackend<'a>, plotters::coord::Shift>;

/// Draws mean, least and greatest value over drones of each figure. `None` if there are no figures.
pub(super) fn draw(samples: &Samples, run: &str) -> Option<Result<String, DrawError>> {
    let own: Vec<&(String, Series<OwnBand>)> =
        samples.own.iter().filter(|(_, series)| !series.samples().is_empty()).collect();
    (!own.is_empty()).then(|| panels(&own, run, samples.end_s))
}

fn panels(own: &[&(String, Series<OwnBand>)], run: &str, end_s: f64) -> Result<String, DrawError> {
    let drawn = &own[..own.len().min(OWN_PANELS_MAX)];
    let columns = drawn.len().min(2) as u32;
    let size = (WIDTH, TITLE + PANEL * (drawn.len() as u32).div_ceil(columns));
    let mut svg = String::new();
    {
        let canvas = SVGBackend::with_string(&mut svg, size).into_drawing_area();
        canvas.fill(&WHITE).map_err(DrawError::new)?;
        let left = (EDGE + px(6)) as i32;
        let title = format!("Figures of pilots: {run}");
        canvas.draw(&Text::new(title, (left, px(24) as i32), text(18))).map_err(DrawError::new)?;
        let count = if drawn.len() < own.len() {
            format!("; the first {} of {}", drawn.len(), own.len())
        } else {
            String::new()
        };
        let about = format!("mean over drones, from the least to the greatest value, over the time in seconds{count}");
        canvas.draw(&Text::new(about, (left, px(46) as i32), text(13))).map_err(DrawError::new)?;
        let (_, below) = canvas.split_vertically(TITLE);
        let areas = below.split_evenly(((drawn.len() as u32).div_ceil(columns) as usize, columns as usize));
        for ((name, series), area) in drawn.iter().zip(&areas) {
            panel(area, name, series.samples(), end_s)?;
        }
        canvas.present().map_err(DrawError::new)?;
    }
    Ok(pixels(svg, size))
}

fn panel(area: &Area<'_>, name: &str, bands: &[OwnBand], end_s: f64) -> Result<(), DrawError> {
    area.draw(&Text::new(name.to_owned(), (LEFT as i32, (NAME - px(12)) as i32), text(14))).map_err(DrawError::new)?;
    let low = bands.iter().map(|band| band.low).fold(f64::INFINITY, f64::min);
    let high = bands.iter().map(|band| band.high).fold(f64::NEG_INFINITY, f64::max);
    // What differs by the residue of arithmetic alone is constant.
    let largest = low.abs().max(high.abs());
    let width = if high - low > largest * 1e-9 { high - low } else { largest.max(1.0) };
    let edge = width * 0.06;
    let value = |value: &f64| on_axis(*value, width);
    let mut chart = ChartBuilder::on(area)
        .margin_top(NAME)
        .margin_right(EDGE)
        .x_label_area_size(BELOW)
        .y_label_area_size(LEFT)
        .build_cartesian_2d(0.0..end_s.max(1e-3), low - edge..high + edge)
        .map_err(DrawError::new)?;
    let (grid, axis) = (GRID.stroke_width(px(1)), INK.stroke_width(px(1)));
    let mut mesh = chart.configure_mesh();
    mesh.label_style(text(12)).x_labels(6).y_labels(4).x_label_formatter(&number).y_label_formatter(&value);
    mesh.bold_line_style(grid).light_line_style(TRANSPARENT).axis_style(axis).draw().map_err(DrawError::new)?;
    let upper = bands.iter().map(|band| (band.t_s, band.high));
    let lower = bands.iter().rev().map(|band| (band.t_s, band.low));
    let outline: Vec<(f64, f64)> = upper.chain(lower).collect();
    chart.draw_series([Polygon::new(outline, BLUE.mix(0.2))]).map_err(DrawError::new)?;
    let line = bands.iter().map(|band| (band.t_s, band.mean()));
    chart.draw_series(LineSeries::new(line, BLUE.stroke_width(px(2)))).map_err(DrawError::new)?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_figure_has_a_panel_and_too_many_are_left_out() {
        let mut samples = Samples { end_s: 2.0, ..Samples::default() };
        assert!(draw(&samples, "run").is_none());
        for number in 0..=OWN_PANELS_MAX {
            let mut series = Series::new(|_: &mut OwnBand, _| {});
            series.push(OwnBand::new(0.0, 1.0));
            series.push(OwnBand::new(1.0, 3.0));
            samples.own.push((format!("figure_{number}"), series));
        }
        let svg = draw(&samples, "run").unwrap().unwrap();
        assert!(svg.contains("figure_0") && svg.contains("figure_23") && !svg.contains("figure_24"));
        assert!(svg.contains("the first 24 of 25"));
        samples.own.truncate(1);
        assert!(!draw(&samples, "run").unwrap().unwrap().contains("the first"));
    }

    #[test]
    fn the_axis_of_a_figure_fits_its_range() {
        let drawn = |values: [f64; 2]| {
            let mut samples = Samples { end_s: 2.0, ..Samples::default() };
            let mut series = Series::new(|_: &mut OwnBand, _| {});
            series.push(OwnBand::new(0.0, values[0]));
            series.push(OwnBand::new(1.0, values[1]));
            samples.own.push(("figure".to_owned(), series));
            let svg = draw(&samples, "run").unwrap().unwrap();
            let texts = svg.split("</text>").filter_map(|part| Some(part.rsplit_once('>')?.1.trim().to_owned()));
            texts.collect::<Vec<String>>()
        };
        let tiny = drawn([0.0, 3e-7]);
        assert!(tiny.contains(&"0.0000002".to_owned()), "{tiny:?}");
        let constant = drawn([0.1 + 0.2, 0.3]);
        let numbers: Vec<&String> = constant.iter().filter(|text| text.parse::<f64>().is_ok()).collect();
        assert!(constant.contains(&"0.3".to_owned()) && numbers.iter().all(|text| text.len() < 6), "{constant:?}");
    }
}
