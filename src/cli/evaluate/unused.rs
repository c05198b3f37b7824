//! Options that an evaluation would ignore. clap refuses those that conflict with one other option.

use super::{EvaluateArguments, needs_imagination};
use clap::Error;
use clap::error::ErrorKind;
use viola_lab::simulate::ClipParams;

/// Refuses options that have no effect with two others, such as `--frames` with `--track` and `--scene`.
pub fn refuse(arguments: &EvaluateArguments) -> Result<(), Error> {
    let EvaluateArguments { home, track, joint, changes, .. } = arguments;
    let (is_scene, is_simulated) = (arguments.scene.is_some(), !arguments.set.is_empty());
    let is_drawn = !arguments.map.is_empty();
    let has_frames = !arguments.frames.is_empty();
    let is_sampled = *home && is_simulated && arguments.clips.is_none();
    let has_one_length = *joint || *changes || *home || (*track && is_simulated);
    let has_networks = arguments.networks.are_given();
    let text = match () {
        () if *track && is_scene && has_frames => {
            "'--frames' cannot be used with '--track --scene': the whole recording is tracked"
        }
        () if *track && is_scene && arguments.clips.is_some() => {
            "'--clips' cannot be used with '--track --scene': the whole recording is tracked"
        }
        () if *home && is_scene && arguments.clips.is_some() => {
            "'--clips' cannot be used with '--home --scene': the recording is cut into excerpts"
        }
        () if is_sampled && has_frames => {
            "'--frames' needs '--clips' with '--home --set': without it the points are sampled without clips"
        }
        () if is_sampled && arguments.drift != ClipParams::default().drift => {
            "'--drift' needs '--clips' with '--home --set': without it the points are sampled without clips"
        }
        () if is_sampled && arguments.seed != 0 => {
            "'--seed' needs '--clips' with '--home --set': without it each home has its own"
        }
        () if has_one_length && arguments.frames.len() > 1 => {
            "'--frames' takes one length with '--joint', '--changes', '--home' and '--track'"
        }
        () if has_networks && (*track || is_sampled) => {
            "'--models' and the flags of its runtime cannot be used with '--track', nor with '--home --set' without '--clips': \
             no network is used"
        }
        () if has_networks && is_drawn && !needs_imagination(arguments) => {
            "'--models' and the flags of its runtime cannot be used with '--map' and these '--methods': no network is used"
        }
        // clap does not enforce `requires` if the required option conflicts with a given one.
        () if !track && !arguments.trajectories.is_empty() => "'--trajectories' needs '--track'",
        () => return Ok(()),
    };
    Err(Error::raw(ErrorKind::ArgumentConflict, format!("{text}\n")))
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::Parser;

    #[derive(Parser)]
    struct Line {
        #[command(flatten)]
        arguments: EvaluateArguments,
    }

    fn parsed(line: &str) -> Result<EvaluateArguments, Error> {
        let words = ["evaluate", "--out", "out"].into_iter().chain(line.split_whitespace());
        let Line { arguments } = Line::try_parse_from(words)?;
        refuse(&arguments).map(|()| arguments)
    }

    #[test]
    fn options_with_an_effect_are_taken() {
        for line in [
            "--scene s",
            "--scene s --lidar l --truth t --frames 60,40 --clips 3 --methods paper,viola --threads 2",
            "--scene s --rescale --frames 40 --keep-poses --seed 1",
            "--set normal --wrong-scale 0.9",
            "--map a --map b --clips 50 --frames 20,30 --methods viola --threads 1",
            "--map a --methods complete-all --models m",
            "--set normal,upper --seeds 1..2 --clips 1 --frames 60,10 --drift 0.01",
            "--set normal --foreign --fit model.json --picture-labels 0.75",
            "--set normal --withhold-poses --keep-poses",
            "--labels --scene s --frames 60,40",
            "--labels --set normal --seeds 1..2 --frames 8,20 --drift 0.01",
            "--home --scene s --lidar l --truth t --frames 40 --models none",
            "--home --set normal --seeds 1..2 --picture-labels 0.75",
            "--home --set normal --seeds 1..2 --clips 10 --frames 40 --drift 0.01 --seed 1 --models none",
            "--joint --set repeated --seeds 1..2 --frames 10 --clips 4 --drift 0.01",
            "--changes --set changed --seeds 1..2 --frames 30 --clips 5 --picture-labels 0.75",
            "--track --scene s --trajectories t --seed 1",
            "--track --set normal --seeds 1..2 --frames 120 --clips 1",
        ] {
            assert!(parsed(line).is_ok(), "{line}");
        }
    }

    /// Evaluations, and options that have no effect with any of them.
    const WITHOUT_EFFECT: &[(&[&str], &[&str])] = &[
        (&["--labels --scene s", "--labels --set normal", "--home --scene s"], &["--clips 3"]),
        (
            &[
                "--labels --scene s",
                "--labels --set normal",
                "--home --scene s",
                "--home --set normal",
                "--joint --set normal",
                "--changes --set normal",
                "--track --scene s",
                "--track --set normal",
            ],
            &[
                "--threads 2",
                "--methods viola",
                "--foreign",
                "--withhold-poses",
                "--keep-poses",
                "--fit model.json",
                "--rescale",
                "--wrong-scale 0.9",
                "--map m",
            ],
        ),
        (
            &["--labels --set normal", "--joint --set normal", "--track --set normal", "--track --scene s"],
            &["--picture-labels 0.75"],
        ),
        (&["--home --set normal"], &["--frames 60", "--drift 0.01", "--seed 1"]),
        (
            &["--home --set normal", "--track --set normal", "--track --scene s", "--map m"],
            &["--models m", "--models none", "--runtime rten", "--device cuda", "--network-threads 2"],
        ),
        (
            &[
                "--home --scene s",
                "--home --set normal --clips 2",
                "--joint --set normal",
                "--changes --set normal",
                "--track --set normal",
            ],
            &["--frames 60,40"],
        ),
        (&["--track --set normal"], &["--drift 0.01", "--trajectories t", "--lidar l --truth t"]),
        (
            &["--track --scene s"],
            &["--frames 60", "--clips 3", "--lidar l --truth t", "--frames 60 --clips 3"],
        ),
        (&["--labels --scene s", "--set normal", "--map m"], &["--lidar l --truth t"]),
        (
            &["--scene s", "--map m", "--home --scene s", "--track --scene s"],
            &[
                "--seeds 1..2",
                "--drift 0.01",
                "--picture-labels 0.75",
                "--foreign",
                "--withhold-poses",
                "--joint",
                "--changes",
            ],
        ),
        (&["--map m"], &["--keep-poses", "--rescale", "--wrong-scale 2", "--trajectories t"]),
        (&["--scene s --rescale", "--set normal --fit model.json"], &["--wrong-scale 2"]),
        (&["--scene s", "--labels --scene s", "--scene s --methods viola"], &["--trajectories t"]),
    ];

    #[test]
    fn options_without_an_effect_are_refused() {
        for (evaluations, options) in WITHOUT_EFFECT {
            for line in
                evaluations.iter().flat_map(|of| options.iter().map(move |with| format!("{of} {with}")))
            {
                let kind = parsed(&line).err().map(|error| error.kind());
                assert_eq!(kind, Some(ErrorKind::ArgumentConflict), "{line}");
            }
        }
    }

    #[test]
    fn clips_have_sixty_frames_by_default() {
        for (line, lengths) in [("--scene s", &[60][..]), ("--scene s --frames 20,10", &[20, 10])] {
            let Ok(arguments) = parsed(line) else { panic!("{line} is refused") };
            assert_eq!((arguments.lengths(), arguments.first_length()), (lengths.to_vec(), lengths[0]));
        }
    }
}
