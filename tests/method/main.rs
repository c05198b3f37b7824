//! The method as a whole, through the crates' front doors and `viola evaluate`.

mod apartment;
mod bars;
mod built_in;
mod completion;
mod early_pose;
mod evaluate;
mod imagination;
mod labels;
mod lidar_maps;
mod map;
mod network;
mod registration;
mod runtimes;
mod scale;
mod simulate;
mod simulated_files;
mod track;
