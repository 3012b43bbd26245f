//! The report as Markdown and as one self-contained HTML page, from the same blocks.

use crate::block::Block;
use std::fmt::Write as _;

const STYLE: &str = "\
:root{color-scheme:light dark;--ink:#222;--paper:#fff;--line:#ccc;--soft:#f3f3f3}
@media(prefers-color-scheme:dark){:root{--ink:#ddd;--paper:#16181b;--line:#444;--soft:#22262b}}
body{font:16px/1.5 system-ui,Helvetica,Arial,sans-serif;color:var(--ink);background:var(--paper);max-width:1140px;\
margin:2rem auto;padding:0 1rem}
p{max-width:48rem}
nav ol{columns:2;max-width:62rem;font-size:14px}
summary{cursor:pointer;padding:.2rem 0}
.wide{overflow-x:auto}
table{border-collapse:collapse;font-size:13px;font-variant-numeric:tabular-nums}
th,td{border-bottom:1px solid var(--line);padding:.25rem .6rem;text-align:left;vertical-align:top}
th{background:var(--soft)}
td:first-child{white-space:nowrap}
code{font-size:12px;background:var(--soft);padding:0 .2em}
figure{margin:1.5rem 0;background:#fff;color:#222;border:1px solid var(--line);break-inside:avoid}
figure svg{display:block;width:100%;height:auto}
figcaption{padding:.4rem .8rem}
@media print{:root{--ink:#000;--paper:#fff;--line:#999;--soft:#fff}body{margin:0;max-width:none;font-size:10pt}\
table{font-size:7pt}th,td{padding:.15em .3em}\
code{font-size:6pt;overflow-wrap:anywhere}td:last-child:has(code){min-width:15em;line-height:1.3}tr{break-inside:avoid}}
";

/// Number of lines up to which a table is open.
const FOLDED: usize = 20;

/// The report as Markdown. It links to the files of the figures.
pub(crate) fn markdown(title: &str, blocks: &[Block]) -> String {
    let mut text = format!("# {title}\n");
    for block in blocks {
        text.push('\n');
        // Writing to a string cannot fail.
        let _ = match block {
            Block::Heading(heading) => writeln!(text, "## {heading}"),
            Block::Contents => headings(blocks).try_for_each(|heading| writeln!(text, "- {heading}")),
            Block::Text(words) => writeln!(text, "{words}"),
            Block::Table { head, lines } => {
                let rule = vec!["---"; head.len()].join(" | ");
                let _ = writeln!(text, "| {} |\n| {rule} |", head.join(" | "));
                lines.iter().try_for_each(|line| writeln!(text, "| {} |", line.join(" | ")))
            }
            Block::Figure(figure) => {
                writeln!(text, "![{}](figures/{})\n\n{}", figure.file, figure.file, figure.caption)
            }
        };
    }
    text
}

/// The report as an HTML page that contains the figures.
pub(crate) fn html(title: &str, blocks: &[Block]) -> String {
    let mut page = format!(
        "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n<meta name=\"viewport\" \
         content=\"width=device-width,initial-scale=1\">\n<title>{0}</title>\n<style>\n{STYLE}</style>\n</head>\n\
         <body>\n<h1>{0}</h1>\n",
        inline(title)
    );
    for block in blocks {
        let _ = match block {
            Block::Heading(heading) => writeln!(page, "<h2 id=\"{}\">{}</h2>", anchor(heading), inline(heading)),
            Block::Contents => {
                let entry = |heading| format!("<li><a href=\"#{}\">{}</a></li>", anchor(heading), inline(heading));
                writeln!(
                    page,
                    "<nav aria-label=\"Contents\"><ol>{}</ol></nav>",
                    headings(blocks).map(entry).collect::<String>()
                )
            }
            Block::Text(words) => writeln!(page, "<p>{}</p>", inline(words)),
            Block::Table { head, lines } => {
                let cells = |tag: &str, line: &[String]| -> String {
                    line.iter().map(|cell| format!("<{tag}>{}</{tag}>", inline(cell))).collect()
                };
                let body: String = lines.iter().map(|line| format!("<tr>{}</tr>\n", cells("td", line))).collect();
                let head = cells("th", head);
                let table = format!(
                    "<div class=\"wide\"><table>\n<thead><tr>{head}</tr></thead>\n<tbody>\n{body}</tbody>\n</table></div>"
                );
                match lines.len() {
                    rows if rows > FOLDED => {
                        writeln!(page, "<details><summary>{rows} rows</summary>\n{table}\n</details>")
                    }
                    _ => writeln!(page, "{table}"),
                }
            }
            Block::Figure(figure) => {
                let caption = inline(&figure.caption);
                writeln!(page, "<figure>\n{}\n<figcaption>{caption}</figcaption>\n</figure>", figure.svg.trim())
            }
        };
    }
    page.push_str("</body>\n</html>\n");
    page
}

/// The headings of the report, in order.
fn headings(blocks: &[Block]) -> impl Iterator<Item = &str> {
    blocks.iter().filter_map(|block| match block {
        Block::Heading(heading) => Some(heading.as_str()),
        _ => None,
    })
}

/// The name of a heading's place in the page.
fn anchor(heading: &str) -> String {
    let letters = heading.chars().map(|c| if c.is_ascii_alphanumeric() { c.to_ascii_lowercase() } else { '-' });
    letters.collect()
}

/// Escapes text for HTML. Text between backticks becomes code.
fn inline(text: &str) -> String {
    let text = text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;");
    let mut html = String::new();
    for (i, part) in text.split('`').enumerate() {
        if i % 2 == 0 {
            html.push_str(part);
        } else {
            html.extend(["<code>", part, "</code>"]);
        }
    }
    html
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_forms_hold_the_same_blocks() {
        let blocks = [
            Block::Heading("Times".to_owned()),
            Block::Contents,
            Block::Text("1 < 2, by `skein run`.".to_owned()),
            Block::Table {
                head: vec!["a".to_owned(), "b".to_owned()],
                lines: vec![vec!["1".to_owned(), "2".to_owned()]],
            },
        ];
        let text = markdown("Report", &blocks);
        assert!(text.starts_with(
            "# Report\n\n## Times\n\n- Times\n\n1 < 2, by `skein run`.\n\n| a | b |\n| --- | --- |\n| 1 | 2 |\n"
        ));
        let page = html("Report", &blocks);
        for part in [
            "<h2 id=\"times\">Times</h2>",
            "<li><a href=\"#times\">Times</a></li>",
            "1 &lt; 2, by <code>skein run</code>.",
            "<td>1</td><td>2</td>",
        ] {
            assert!(page.contains(part), "{part} is not in {page}");
        }
    }
}
