use super::super::settings::{Ddim, Euler, Latents};
use super::*;
use serde::Deserialize;

/// Result of a scheduler of `diffusers` for a number; written by models/export/tiny_stable_diffusion.py.
#[derive(Debug, Deserialize)]
struct Row {
    by: Scheduler,
    timestep_spacing: Spacing,
    prediction_type: Prediction,
    beta_schedule: BetaSchedule,
    set_alpha_to_one: bool,
    timesteps: Vec<f64>,
    start: f64,
    end: f64,
}

fn settings(row: &Row) -> Settings {
    Settings {
        latents: Latents { channels: 4, cell: 8, scaling_factor: 0.18215 },
        noise: NoiseLevels {
            train_steps: 1000,
            beta_start: 0.00085,
            beta_end: 0.012,
            beta_schedule: row.beta_schedule,
            prediction_type: row.prediction_type,
        },
        ddim: Ddim {
            timestep_spacing: row.timestep_spacing,
            steps_offset: 1,
            set_alpha_to_one: row.set_alpha_to_one,
        },
        euler: Euler { timestep_spacing: row.timestep_spacing, steps_offset: 1 },
    }
}

fn rows() -> Vec<Row> {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/models/stable_diffusion/schedules.json");
    serde_json::from_slice(&std::fs::read(path).unwrap()).unwrap()
}

#[test]
fn every_schedule_is_that_of_diffusers() {
    let rows = rows();
    assert_eq!(rows.len(), 36);
    for row in rows {
        let schedule = Schedule::new(&settings(&row), row.by, row.timesteps.len()).unwrap();
        let mut value = 0.7 * schedule.start;
        for (place, (step, timestep)) in schedule.steps.iter().zip(&row.timesteps).enumerate() {
            assert!((step.timestep - timestep).abs() < 2e-3, "{row:?}: {}", step.timestep);
            let said = (place as f64).sin() + 0.1 * value * step.input_scale;
            value = value * step.keep + said * step.add;
        }
        let near = |got: f64, want: f64| (got - want).abs() < 1e-4 * want.abs().max(1.0);
        assert!(near(schedule.start, row.start), "{row:?}: starts with {}", schedule.start);
        assert!(near(value, row.end), "{row:?}: ends with {value}");
    }
}

#[test]
fn steps_outside_the_training_are_refused() {
    let row = &rows()[0];
    for steps in [0, 1001] {
        assert!(Schedule::new(&settings(row), Scheduler::Ddim, steps).is_err(), "{steps}");
    }
    // With an offset of one, 1000 steps leave the training's range.
    assert!(Schedule::new(&settings(row), Scheduler::Ddim, 1000).is_err());
    assert!(Schedule::new(&settings(row), Scheduler::Ddim, 999).is_ok());
}
