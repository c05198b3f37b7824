//! `viola evaluate`: clips with a known truth, methods that find it, results that outlive an interruption,
//! and tables that add up.

mod real;

#[path = "evaluate/command.rs"]
mod command;
#[path = "evaluate/flat.rs"]
mod flat;
#[path = "evaluate/methods.rs"]
mod methods;
#[path = "evaluate/resume.rs"]
mod resume;
#[path = "evaluate/survey.rs"]
mod survey;
#[path = "evaluate/table.rs"]
mod table;
