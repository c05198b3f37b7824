//! Libraries that are no usable ONNX Runtime. A file of its own, because a process loads one library only.
#![cfg(unix)]

use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::Mutex;
use viola_network::{Network, NetworkError, RuntimeParams, open};

static WARNINGS: Mutex<Vec<String>> = Mutex::new(Vec::new());

fn model() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/models/red.onnx")
}

/// Builds a library from the C code `body`, with the types of ONNX Runtime's entry point before it.
fn imitation(folder: &Path, name: &str, body: &str) -> PathBuf {
    let (source, library) = (folder.join(format!("{name}.c")), folder.join(format!("lib{name}.so")));
    let code = format!(
        "struct base {{ const void *(*interface)(unsigned); const char *(*version)(void); }};
         static const void *none(unsigned n) {{ (void)n; return 0; }}
         {body}"
    );
    std::fs::write(&source, code).unwrap();
    let compiler = Command::new("cc").args(["-shared", "-fPIC", "-o"]).arg(&library).arg(&source).status();
    assert!(compiler.is_ok_and(|status| status.success()), "the C compiler that builds SQLite is needed");
    library
}

/// Returns the entry point of a library of this version, with the function that returns its interface.
fn base(version: &str, interface: &str) -> String {
    format!(
        "static const char *version(void) {{ return {version}; }}
         static struct base it = {{ {interface}, version }};
         const struct base *OrtGetApiBase(void) {{ return &it; }}"
    )
}

/// Returns a library that can be loaded, and has no session: of its table's functions, those of the environment succeed.
fn without_sessions() -> String {
    let interface = "
        static void *fail(void) { return &fail; }
        static void *succeed(void) { return 0; }
        static unsigned code(void) { return 1; }
        static const char *message(void) { return \"no session today\"; }
        static void *environment(void *log, void *to, int level, const char *name, void **out) {
            (void)log; (void)to; (void)level; (void)name;
            *out = &environment;
            return 0;
        }
        static void *table[1024];
        static const void *interface(unsigned n) {
            (void)n;
            for (int i = 0; i < 1024; i++) table[i] = fail;
            table[1] = code; table[2] = message; table[4] = environment; table[5] = table[6] = succeed;
            return table;
        }";
    format!("{interface}\n{}", base("\"1.99.0\"", "interface"))
}

fn named(library: PathBuf) -> RuntimeParams {
    RuntimeParams { library: Some(library), ..RuntimeParams::default() }
}

/// Returns the parameters with which a copy of a library is found.
fn finding(folder: &Path, library: &Path) -> RuntimeParams {
    let look_in = folder.join(library.file_stem().unwrap());
    std::fs::create_dir(&look_in).unwrap();
    std::fs::copy(library, look_in.join("libonnxruntime.so")).unwrap();
    let warn = |text: &str| WARNINGS.lock().unwrap().push(text.to_owned());
    RuntimeParams { look_in: vec![look_in], warn: Some(warn), ..RuntimeParams::default() }
}

fn check_refused(opened: Result<std::sync::Arc<Network>, NetworkError>, told: &str) {
    match opened {
        Ok(network) => panic!("{told}: {} runs it", network.runtime()),
        Err(error) => assert!(error.to_string().contains(told), "{told}: {error}"),
    }
}

/// Checks that `rten` runs a network beside a library, and that the cause is told.
fn check_replaced(params: &RuntimeParams, told: &str) {
    let network = open(&model(), params).unwrap();
    assert!(network.runtime().starts_with("rten") && network.reason().contains(told), "{}", network.reason());
    let warnings = std::mem::take(&mut *WARNINGS.lock().unwrap());
    assert!(warnings.len() == 1 && warnings[0].contains(told), "{warnings:?}");
    assert!(warnings[0].starts_with("red.onnx runs in rten"), "{warnings:?}");
}

#[test]
fn other_libraries_are_refused_if_they_are_named_and_replaced_if_they_are_found() {
    let folder = tempfile::tempdir().unwrap();
    let put = |name: &str, bytes: &[u8]| {
        let path = folder.path().join(name);
        std::fs::write(&path, bytes).unwrap();
        path
    };
    let imitation = |name: &str, body: &str| imitation(folder.path(), name, body);
    for (library, told) in [
        (folder.path().join("nowhere.so"), "cannot be read"),
        (put("empty.so", b""), "no usable library"),
        (put("text.so", b"this is not a library\n"), "no usable library"),
        (put("cut.so", b"\x7fELF\x02\x01\x01\0\0\0\0\0"), "no usable library"),
        (folder.path().to_owned(), "no usable library"),
        (imitation("other", "int viola_other;"), "it has no OrtGetApiBase"),
        (imitation("null", "const struct base *OrtGetApiBase(void) { return 0; }"), "no interface"),
        (imitation("mute", &base("0", "none")), "version"),
        (imitation("odd", &base("\"spring\"", "none")), "too old"),
        (imitation("hollow", &base("\"1.99.0\"", "none")), "does not offer interface"),
    ] {
        check_refused(open(&model(), &named(library)), told);
    }
    let old = imitation("old", &base("\"1.9.0\"", "none"));
    check_refused(open(&model(), &named(old.clone())), "is ONNX Runtime 1.9.0, which is too old");
    check_replaced(&finding(folder.path(), &old), "is ONNX Runtime 1.9.0, which is too old");

    // It stays loaded, so it comes last.
    let found = finding(folder.path(), &imitation("sessionless", &without_sessions()));
    check_replaced(&found, "no session today");
    let library = found.look_in[0].join("libonnxruntime.so");
    check_refused(open(&model(), &named(library)), "no session today");
    let broken = put("broken.onnx", b"no network");
    for told in ["broken.onnx is not an ONNX model", "in ONNX Runtime: no session today"] {
        check_refused(open(&broken, &found), told);
    }
    assert!(WARNINGS.lock().unwrap().is_empty());
}
