//! The files for robots and homes, as `GET /v1/homes/{home}/map/robot` gives them.

use anyhow::{Context, Result};
use viola_home::{Ground, PlanImage, RobotLevel, Tile};

/// Returns the files of a level by name. `valetudo` is its LiDAR map, if it is Valetudo's JSON.
pub fn files(
    level: &RobotLevel,
    tiles: &[Tile],
    plan_json: &[u8],
    valetudo: Option<&[u8]>,
) -> Result<Vec<(&'static str, Vec<u8>)>> {
    let mut ground = Ground::new(level.lidar);
    tiles.iter().for_each(|tile| ground.add(tile));
    let image = PlanImage::in_plan_json(plan_json).context("plan.json has no image")?;
    let places = viola_home::robot_places(level);
    Ok(vec![
        ("nav2.zip", viola_home::nav2_zip(&viola_home::nav2_files(level, &places, &ground)?)),
        ("calibration.json", serde_json::to_vec(&viola_home::calibration(level, &places, &image))?),
        ("valetudo.json", serde_json::to_vec(&viola_home::valetudo(level, &places, valetudo))?),
    ])
}
