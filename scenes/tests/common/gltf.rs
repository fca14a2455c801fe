//! Small glTF files, as text with their data in it or binary.

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;

/// A glTF file while it is made: accessors and buffer views over one buffer.
#[derive(Default)]
pub(crate) struct Maker {
    data: Vec<u8>,
    views: Vec<String>,
    accessors: Vec<String>,
}

impl Maker {
    /// A view of bytes, by number.
    pub(crate) fn view(&mut self, bytes: &[u8]) -> usize {
        while !self.data.len().is_multiple_of(4) {
            self.data.push(0);
        }
        let (offset, length) = (self.data.len(), bytes.len());
        self.views.push(format!(
            r#"{{"buffer":0,"byteOffset":{offset},"byteLength":{length}}}"#
        ));
        self.data.extend(bytes);
        self.views.len() - 1
    }

    /// An accessor with JSON of its own, by number.
    pub(crate) fn accessor(&mut self, json: String) -> usize {
        self.accessors.push(json);
        self.accessors.len() - 1
    }

    /// An accessor of floats; positions need bounds, which nobody checks here.
    pub(crate) fn floats<const N: usize>(&mut self, values: &[[f32; N]]) -> usize {
        let bytes: Vec<u8> = values
            .iter()
            .flatten()
            .flat_map(|x| x.to_le_bytes())
            .collect();
        let view = self.view(&bytes);
        let (zeros, count) = (vec!["0"; N].join(","), values.len());
        self.accessor(format!(
            r#"{{"bufferView":{view},"componentType":5126,"count":{count},"type":"VEC{N}","min":[{zeros}],"max":[{zeros}]}}"#
        ))
    }

    /// An accessor of indices of 1, 2 or 4 bytes.
    pub(crate) fn indices(&mut self, values: &[u32], width: usize) -> usize {
        let bytes: Vec<u8> = values
            .iter()
            .flat_map(|i| i.to_le_bytes()[..width].to_vec())
            .collect();
        let view = self.view(&bytes);
        let kind = [5121, 5123, 0, 5125][width - 1];
        let count = values.len();
        self.accessor(format!(
            r#"{{"bufferView":{view},"componentType":{kind},"count":{count},"type":"SCALAR"}}"#
        ))
    }

    fn json(&self, uri: Option<&str>, rest: &str) -> String {
        let uri = uri.map_or(String::new(), |u| format!(r#""uri":"{u}","#));
        format!(
            r#"{{"asset":{{"version":"2.0"}},"buffers":[{{{uri}"byteLength":{}}}],"bufferViews":[{}],"accessors":[{}],{rest}}}"#,
            self.data.len(),
            self.views.join(","),
            self.accessors.join(",")
        )
    }

    /// A text file with its data in it; `rest` is whatever other keys it has.
    pub(crate) fn text(&self, rest: &str) -> String {
        let uri = format!(
            "data:application/octet-stream;base64,{}",
            STANDARD.encode(&self.data)
        );
        self.json(Some(&uri), rest)
    }

    /// A text file and the data that it names as `uri`.
    pub(crate) fn text_and_data(&self, uri: &str, rest: &str) -> (String, &[u8]) {
        (self.json(Some(uri), rest), &self.data)
    }

    /// A binary file.
    pub(crate) fn binary(&self, rest: &str) -> Vec<u8> {
        let mut json = self.json(None, rest).into_bytes();
        while !json.len().is_multiple_of(4) {
            json.push(b' ');
        }
        let mut data = self.data.clone();
        while !data.len().is_multiple_of(4) {
            data.push(0);
        }
        let word = |n: usize| (n as u32).to_le_bytes();
        let length = 12 + 8 + json.len() + 8 + data.len();
        let mut out = b"glTF".to_vec();
        out.extend([word(2), word(length), word(json.len())].concat());
        out.extend(b"JSON");
        out.extend(json);
        out.extend(word(data.len()));
        out.extend(b"BIN\0");
        out.extend(data);
        out
    }
}

/// One triangle, shown by one node.
pub(crate) fn triangle() -> (Maker, String) {
    let mut maker = Maker::default();
    let p = maker.floats(&[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]);
    let i = maker.indices(&[0, 1, 2], 2);
    let rest = format!(
        r#""nodes":[{{"mesh":0,"name":"n"}}],"meshes":[{{"primitives":[{{"attributes":{{"POSITION":{p}}},"indices":{i}}}]}}]"#
    );
    (maker, rest)
}
