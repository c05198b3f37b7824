//! `viola evaluate`: clips with a known truth, methods that find it, results that survive an interruption,
//! and tables that add up.

mod command;
mod flat;
mod methods;
mod resume;
mod survey;
mod table;
