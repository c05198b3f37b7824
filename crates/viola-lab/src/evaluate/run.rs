//! Runs all methods on all clips, on all cores, each clip on one thread.

use super::record::{self, Seconds};
use super::{Case, ClipResult, Journal, Method, RunError, Sample, Suite, failure};
use sha2::{Digest, Sha256};
use std::collections::BTreeMap;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use viola_align::{AlignParams, AlignmentState};
use viola_geometry::progress::{Progress, Stage};
use viola_geometry::stopwatch::Stopwatch;

/// Inputs and outputs of a run.
pub struct Run<'a> {
    pub suite: &'a dyn Suite,
    pub methods: &'a [Method],
    /// Parameters of the observation; the same for all methods.
    pub observe: &'a AlignParams,
    /// Concurrent clips. Each runs on one thread, so times are comparable.
    pub workers: usize,
    /// Journal of earlier and new results.
    pub journal: Option<&'a Journal>,
    /// Version of the program and of its networks: results of other versions are ignored.
    pub program: &'a str,
    /// Folder for a picture of every failed clip. Of clips with the map of another home, the aligned ones failed.
    pub pictures: Option<&'a Path>,
}

impl Run<'_> {
    /// Returns the maximum number of results.
    pub fn total(&self) -> usize {
        self.suite.cases().len() * self.methods.len()
    }

    /// Runs everything missing from the journal, and returns all results in the order of the cases and
    /// methods. `report` is called for every result, from several threads, in no order.
    pub fn results(
        &self,
        progress: &dyn Progress,
        report: &(dyn Fn(&ClipResult) + Sync),
    ) -> Result<Vec<ClipResult>, RunError> {
        let fingerprints: Vec<String> = self.methods.iter().map(|method| self.fingerprint(method)).collect();
        let cases = self.suite.cases();
        let next = AtomicUsize::new(0);
        let done: Mutex<BTreeMap<usize, Vec<ClipResult>>> = Mutex::default();
        let work = || -> Result<(), RunError> {
            // A pool of one thread: the method's parallel parts stay on this thread.
            let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build()?;
            loop {
                let index = next.fetch_add(1, Ordering::Relaxed);
                let Some(case) = cases.get(index) else { return Ok(()) };
                let results = pool.install(|| self.case(index, case, &fingerprints, progress, report));
                // Stops the other workers after their current clips.
                let results = results.inspect_err(|_| next.store(cases.len(), Ordering::Relaxed))?;
                done.lock().unwrap_or_else(|poisoned| poisoned.into_inner()).insert(index, results);
            }
        };
        std::thread::scope(|scope| {
            let workers = self.workers.clamp(1, cases.len().max(1));
            let threads: Vec<_> = (0..workers).map(|_| scope.spawn(work)).collect();
            threads.into_iter().try_for_each(|thread| match thread.join() {
                Ok(result) => result,
                Err(panic) => std::panic::resume_unwind(panic),
            })
        })?;
        let done = done.into_inner().unwrap_or_else(|poisoned| poisoned.into_inner());
        Ok(done.into_values().flatten().collect())
    }

    /// Returns the number of cases without a true pose, given the results of the others.
    pub fn left_out(&self, results: &[ClipResult]) -> usize {
        // A case has a result of every method, or none.
        (self.total() - results.len()) / self.methods.len().max(1)
    }

    fn case(
        &self,
        index: usize,
        case: &Case,
        fingerprints: &[String],
        progress: &dyn Progress,
        report: &(dyn Fn(&ClipResult) + Sync),
    ) -> Result<Vec<ClipResult>, RunError> {
        let known = |at: usize| self.journal?.find(&fingerprints[at], &self.methods[at].name, case).cloned();
        let mut results: Vec<Option<ClipResult>> = (0..self.methods.len()).map(known).collect();
        results.iter().flatten().for_each(report);
        if results.iter().any(Option::is_none) {
            let watch = Stopwatch::around(progress, std::time::Instant::now);
            let Some(sample) = self.suite.sample(index, self.observe, &watch)? else { return Ok(Vec::new()) };
            let observe_seconds: f64 = watch.stop().values().sum();
            let coverage = record::coverage(&sample);
            for (at, method) in self.methods.iter().enumerate() {
                if results[at].is_none() {
                    let result = self.one(case, method, &sample, coverage, observe_seconds, progress)?;
                    if let Some(journal) = self.journal {
                        journal.append(&fingerprints[at], &result)?;
                    }
                    report(&result);
                    results[at] = Some(result);
                }
            }
        }
        let results: Vec<ClipResult> = results.into_iter().flatten().collect();
        // A picture of an earlier run shows a failure that this result is not.
        for path in
            results.iter().filter(|result| !has_failed(result)).filter_map(|r| self.picture(case, &r.method))
        {
            match std::fs::remove_file(&path) {
                Err(source) if source.kind() != ErrorKind::NotFound => {
                    return Err(RunError::Picture { path, source });
                }
                _ => {}
            }
        }
        Ok(results)
    }

    /// Returns the path of the picture of a failed clip.
    fn picture(&self, case: &Case, method: &str) -> Option<PathBuf> {
        let name = format!("{}_{}_{}_{method}.png", case.set, case.frames, case.name);
        self.pictures.map(|folder| folder.join(name))
    }

    fn one(
        &self,
        case: &Case,
        method: &Method,
        sample: &Sample,
        coverage: Option<f64>,
        observe_seconds: f64,
        progress: &dyn Progress,
    ) -> Result<ClipResult, RunError> {
        let watch = Stopwatch::around(progress, std::time::Instant::now);
        let alignment =
            method.register(sample, &watch).map_err(|error| RunError::of_clip(&case.name, error))?;
        let laps = watch.stop();
        let lap = |stage: Stage| laps.get(stage.name()).copied().unwrap_or(0.0);
        let register = lap(Stage::Search) + lap(Stage::Refine) + lap(Stage::Decide);
        let seconds = Seconds { register, all: observe_seconds + laps.values().sum::<f64>() };
        let result = ClipResult::new(case, &method.name, sample, &alignment, coverage, seconds);
        if let Some(path) = self.picture(case, &method.name).filter(|_| has_failed(&result)) {
            std::fs::write(&path, failure::picture(sample, alignment))
                .map_err(|source| RunError::Picture { path, source })?;
        }
        Ok(result)
    }

    /// Returns the hash of everything that a method's results depend on.
    fn fingerprint(&self, method: &Method) -> String {
        let parts = [
            self.program,
            &self.suite.fingerprint(),
            &format!("{:?}", self.observe),
            &format!("{:?}", method.kind),
        ];
        let mut hash = Sha256::new();
        for part in parts {
            hash.update((part.len() as u64).to_le_bytes());
            hash.update(part);
        }
        hash.finalize().iter().take(8).map(|byte| format!("{byte:02x}")).collect()
    }
}

fn has_failed(result: &ClipResult) -> bool {
    if result.foreign { result.state == AlignmentState::Aligned } else { !result.is_success() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use viola_geometry::progress::Silent;

    /// Cases without a true pose.
    struct Untold(Vec<Case>);

    impl Suite for Untold {
        fn cases(&self) -> &[Case] {
            &self.0
        }

        fn fingerprint(&self) -> String {
            String::new()
        }

        fn sample(
            &self,
            _index: usize,
            _params: &AlignParams,
            _progress: &dyn Progress,
        ) -> Result<Option<Sample>, RunError> {
            Ok(None)
        }
    }

    /// A run on one thread, without a journal and pictures.
    fn alone<'a>(suite: &'a Untold, methods: &'a [Method], observe: &'a AlignParams) -> Run<'a> {
        Run { suite, methods, observe, workers: 1, journal: None, program: "", pictures: None }
    }

    #[test]
    fn clips_without_a_true_pose_are_counted_once_for_all_methods() {
        let case = |name: &str| Case { name: name.into(), set: "home".into(), frames: 5 };
        let suite = Untold(["a", "b", "c"].map(case).to_vec());
        let methods = ["viola", "paper"].map(|name| Method::named(name, 0, None).unwrap());
        let observe = AlignParams::default();
        let run = alone(&suite, &methods, &observe);
        let results = run.results(&Silent, &|_| {}).unwrap();
        assert_eq!((results.len(), run.total(), run.left_out(&results)), (0, 6, 3));
    }

    #[test]
    fn in_the_map_of_another_home_only_an_aligned_clip_has_failed() {
        for (foreign, state, failed) in [
            (true, AlignmentState::Aligned, true),
            (true, AlignmentState::Ambiguous, false),
            (false, AlignmentState::Ambiguous, true),
        ] {
            let result = ClipResult { foreign, ..ClipResult::example(state, None) };
            assert_eq!(has_failed(&result), failed, "{foreign} {state:?}");
        }
    }

    #[test]
    fn a_clip_that_has_not_failed_keeps_no_picture() {
        let folder = std::env::temp_dir().join(format!("viola-lab-run-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let right = ClipResult::example(AlignmentState::Aligned, Some((0.1, 0.01)));
        let wrong =
            ClipResult { clip: "000002_0".into(), ..ClipResult::example(AlignmentState::Failed, None) };
        let case = |of: &ClipResult| Case { name: of.clip.clone(), set: of.set.clone(), frames: of.frames };
        let suite = Untold(vec![case(&right), case(&wrong)]);
        let methods = [Method::named("viola", 0, None).unwrap()];
        let observe = AlignParams::default();
        let run = Run { pictures: Some(&folder), ..alone(&suite, &methods, &observe) };
        let path = folder.join("results.jsonl");
        let journal = Journal::open(&path).unwrap();
        let pictures = suite.cases().iter().map(|case| run.picture(case, "viola").unwrap());
        let pictures: Vec<PathBuf> = pictures.collect();
        for (result, picture) in [&right, &wrong].into_iter().zip(&pictures) {
            journal.append(&run.fingerprint(&methods[0]), result).unwrap();
            std::fs::write(picture, "").unwrap();
        }
        let journal = Journal::open(&path).unwrap();
        let run = Run { journal: Some(&journal), ..run };
        run.results(&Silent, &|_| {}).unwrap();
        let left: Vec<bool> = pictures.iter().map(|picture| picture.exists()).collect();
        assert_eq!((left, journal.found()), (vec![false, true], 2));
        std::fs::remove_dir_all(&folder).unwrap();
    }
}
