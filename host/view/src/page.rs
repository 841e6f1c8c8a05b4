//! The page: three files that are part of the program.

/// A file of the page.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct File {
    pub path: &'static str,
    pub kind: &'static str,
    pub text: &'static str,
}

/// All there are.
pub(crate) const FILES: [File; 3] = [
    File { path: "/", kind: "text/html; charset=utf-8", text: include_str!("../page/index.html") },
    File {
        path: "/view.css",
        kind: "text/css; charset=utf-8",
        text: include_str!("../page/view.css"),
    },
    File {
        path: "/view.js",
        kind: "text/javascript; charset=utf-8",
        text: include_str!("../page/view.js"),
    },
];

/// What the page may load and reach: its own files, and the server that it came from under the name
/// that was checked.
pub(crate) fn policy(host: &str) -> String {
    format!(
        "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; \
         connect-src 'self' ws://{host}; base-uri 'none'; form-action 'none'; \
         frame-ancestors 'none'"
    )
}
