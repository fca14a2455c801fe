//! Tables, as HTML and as CSV.

use super::page::escape;

/// A table with its caption; the same cells go to the page and to a CSV file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Table {
    /// Stem of the CSV file.
    pub file: String,
    /// One sentence above the table.
    pub caption: String,
    /// Column heads, with units.
    pub columns: Vec<String>,
    /// Rows of as many cells.
    pub rows: Vec<Vec<String>>,
}

impl Table {
    /// An empty table.
    pub fn new(file: &str, caption: &str, columns: &[&str]) -> Self {
        Self {
            file: file.to_owned(),
            caption: caption.to_owned(),
            columns: columns.iter().map(|c| (*c).to_owned()).collect(),
            rows: Vec::new(),
        }
    }

    /// Adds a row; missing cells are filled with nothing, surplus ones are kept for the reader to see.
    pub fn row<S: Into<String>>(&mut self, cells: impl IntoIterator<Item = S>) {
        let mut cells: Vec<String> = cells.into_iter().map(Into::into).collect();
        cells.resize(cells.len().max(self.columns.len()), String::new());
        self.rows.push(cells);
    }

    /// The table as HTML; cells that are numbers are set flush right.
    pub fn to_html(&self) -> String {
        let head: String = self
            .columns
            .iter()
            .map(|c| format!("<th>{}</th>", escape(c)))
            .collect();
        let cell = |text: &String| {
            let class = if text.parse::<f64>().is_ok() {
                " class=\"n\""
            } else {
                ""
            };
            format!("<td{class}>{}</td>", escape(text))
        };
        let rows: String = self
            .rows
            .iter()
            .map(|row| format!("<tr>{}</tr>\n", row.iter().map(cell).collect::<String>()))
            .collect();
        format!(
            "<table><caption>{} <a href=\"{file}.csv\">CSV</a></caption>\n<thead><tr>{head}</tr></thead>\n<tbody>\n{rows}</tbody></table>\n",
            escape(&self.caption),
            file = escape(&self.file),
        )
    }

    /// The table as RFC 4180 comma-separated values with a head line.
    pub fn to_csv(&self) -> String {
        let line =
            |cells: &[String]| cells.iter().map(|c| quote(c)).collect::<Vec<_>>().join(",") + "\n";
        line(&self.columns) + &self.rows.iter().map(|row| line(row)).collect::<String>()
    }
}

fn quote(cell: &str) -> String {
    if cell.contains([',', '"', '\n', '\r']) {
        format!("\"{}\"", cell.replace('"', "\"\""))
    } else {
        cell.to_owned()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn html_is_escaped_and_csv_quoted() {
        let mut table = Table::new("t", "a < b", &["name", "ms"]);
        table.row(["a \"b\", c", "1.5"]);
        table.row(["<i>"]);
        assert_eq!(table.to_csv(), "name,ms\n\"a \"\"b\"\", c\",1.5\n<i>,\n");
        let html = table.to_html();
        assert!(
            html.contains("a &lt; b") && html.contains("<td class=\"n\">1.5</td>"),
            "{html}"
        );
        assert!(!html.contains("<i>"));
    }
}
