//! The plots of a run inside the page, in the colours of the page.

use crate::plot::Plot;

/// The colours of the plots that depend on the page's theme, and their CSS variables.
const THEMED: [(&str, &str); 6] = [
    ("#FFFFFF", "var(--paper)"),
    ("#333333", "var(--ink)"),
    ("#E8E8E8", "var(--grid)"),
    ("#8C8C8C", "var(--grey)"),
    ("#BEBEBE", "var(--block)"),
    ("#CC1E14", "var(--bad)"),
];

/// The figures of the page.
pub(super) fn all(plots: &[Plot]) -> String {
    let mut html = "<h2>Figures</h2><div class=\"figures\">".to_owned();
    // The replay shows more than the animation, which is left out.
    for Plot { file, svg } in plots.iter().filter(|plot| plot.file != "flight.svg") {
        let name = file.trim_end_matches(".svg");
        html += &format!("<figure id=\"{name}\">{}</figure>", themed(svg));
    }
    html + "</div>"
}

/// Replaces colours only where they are a whole attribute, so that text in a plot does not change.
fn themed(svg: &str) -> String {
    let mut svg = svg.to_owned();
    for (colour, name) in THEMED {
        for attribute in ["fill", "stroke"] {
            svg = svg.replace(&format!("{attribute}=\"{colour}\""), &format!("{attribute}=\"{name}\""));
        }
    }
    svg
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn background_and_ink_follow_the_theme() {
        let svg = r##"<rect fill="#FFFFFF" stroke="#333333"/><path stroke="#0072B2"/><text>fill #FFFFFF</text>"##;
        let wanted =
            r##"<rect fill="var(--paper)" stroke="var(--ink)"/><path stroke="#0072B2"/><text>fill #FFFFFF</text>"##;
        assert_eq!(themed(svg), wanted);
    }
}
