//! An interrupted run resumes where it stopped.

use super::flat;
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};
use viola_align::AlignParams;
use viola_geometry::progress::{Progress, Silent};
use viola_lab::evaluate::{
    Case, ClipResult, DrawnClips, DrawnParams, Journal, JournalError, Method, Run, RunError, Sample, Suite,
};

/// Counts the clips that are made.
struct Counting {
    inner: DrawnClips,
    made: AtomicUsize,
}

impl Suite for Counting {
    fn cases(&self) -> &[Case] {
        self.inner.cases()
    }
    fn fingerprint(&self) -> String {
        self.inner.fingerprint()
    }
    fn sample(
        &self,
        index: usize,
        params: &AlignParams,
        progress: &dyn Progress,
    ) -> Result<Option<Sample>, RunError> {
        self.made.fetch_add(1, Ordering::Relaxed);
        self.inner.sample(index, params, progress)
    }
}

/// Runs four clips; returns the results and the number of clips that were made.
fn run(folder: &Path, program: &str, methods: &[&str]) -> (Vec<ClipResult>, usize) {
    let drawn = DrawnParams { clips: 4, frames: vec![20], ..DrawnParams::default() };
    let inner = DrawnClips::open(&[flat::write(folder)], drawn).unwrap();
    let suite = Counting { inner, made: AtomicUsize::new(0) };
    let methods: Vec<Method> = methods.iter().map(|name| Method::named(name, 0, None).unwrap()).collect();
    let journal = Journal::open(&folder.join("results.jsonl")).unwrap();
    let observe = AlignParams::default();
    let run = Run {
        suite: &suite,
        methods: &methods,
        observe: &observe,
        workers: 1,
        journal: Some(&journal),
        program,
        pictures: None,
    };
    let heard = AtomicUsize::new(0);
    let report = |_: &ClipResult| _ = heard.fetch_add(1, Ordering::Relaxed);
    let results = run.results(&Silent, &report).unwrap();
    assert_eq!(heard.into_inner(), results.len(), "results from the journal are reported too");
    (results, suite.made.into_inner())
}

#[test]
fn only_what_is_missing_is_computed() {
    let folder = tempfile::tempdir().unwrap();
    let journal = folder.path().join("results.jsonl");
    let (first, made) = run(folder.path(), "a", &["viola"]);
    assert_eq!((first.len(), made), (4, 4));
    assert_eq!(
        run(folder.path(), "a", &["viola"]),
        (first.clone(), 0),
        "times too are those of the first run"
    );

    // The machine lost power while the last line was being written.
    let text = std::fs::read(&journal).unwrap();
    let last_line = text[..text.len() - 1].iter().rposition(|b| *b == b'\n').unwrap() + 1;
    for cut in [last_line + 1, (last_line + text.len()) / 2, text.len() - 1] {
        std::fs::write(&journal, &text[..cut]).unwrap();
        let (again, made) = run(folder.path(), "a", &["viola"]);
        assert_eq!(made, 1, "cut at {cut}");
        assert_eq!(again[..3], first[..3]);
        assert_eq!(again[3].translation_error_m, first[3].translation_error_m);
        assert_eq!(std::fs::read(&journal).unwrap().iter().filter(|b| **b == b'\n').count(), 4);
    }

    // Another method is missing everywhere; the first one is not computed again.
    let (both, made) = run(folder.path(), "a", &["viola", "viola-without-free-space"]);
    assert_eq!((both.len(), made), (8, 4));
    // Another program has no results yet, and does not remove those of the first one.
    assert_eq!(run(folder.path(), "b", &["viola"]).1, 4);
    assert_eq!(run(folder.path(), "a", &["viola"]).1, 0);
}

#[test]
fn damage_before_the_end_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("results.jsonl");
    run(folder.path(), "a", &["viola"]);
    let text = std::fs::read_to_string(&path).unwrap();
    std::fs::write(&path, text.replacen("\"method\"", "\"meth", 2)).unwrap();
    match Journal::open(&path) {
        Err(JournalError::Damaged { line, .. }) => assert_eq!(line, 1),
        Err(other) => panic!("{other}"),
        Ok(_) => panic!("a damaged line was read"),
    }
}
