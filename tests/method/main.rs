//! The method as a whole, through the crates' front doors and `viola evaluate`.

mod apartment;
mod completion;
mod evaluate;
mod imagination;
mod labels;
mod network;
mod registration;
mod runtimes;
mod simulate;
mod simulated_files;
mod track;
