//! Checks that a loaded network has the inputs and outputs of its manifest entry.

use super::tensor::shown;
use super::{Element, TensorInfo};

/// Returns the input or output called `name`, or the only one; `what` is its word in the message.
pub fn one<'a>(infos: &'a [TensorInfo], name: Option<&str>, what: &str) -> Result<&'a TensorInfo, String> {
    match (name, infos) {
        (Some(name), _) => infos.iter().find(|info| info.name == name).ok_or_else(|| {
            let names: Vec<&str> = infos.iter().map(|info| info.name.as_str()).collect();
            format!("it has no {what} {name}, but {}", names.join(", "))
        }),
        (None, [only]) => Ok(only),
        (None, _) => Err(format!("it has {} {what}s; name one", infos.len())),
    }
}

/// Checks a tensor's type and axes. A type unknown in the file and an axis of `None` match anything.
pub fn expect(info: &TensorInfo, what: &str, element: Element, axes: &[Option<usize>]) -> Result<(), String> {
    let name = &info.name;
    if info.element.is_some_and(|got| got != element) {
        let numbers = match element {
            Element::F32 => "32-bit floating-point numbers",
            Element::I64 => "whole numbers",
            Element::U8 => "bytes",
            Element::Bool => "truth values",
        };
        return Err(format!("its {what} {name} is not of {numbers}"));
    }
    let Some(shape) = &info.shape else { return Ok(()) };
    let meets = |(got, want): (&Option<usize>, &Option<usize>)| match (got, want) {
        (Some(got), Some(want)) => got == want,
        _ => true,
    };
    if shape.len() != axes.len() || !shape.iter().zip(axes).all(meets) {
        return Err(format!("its {what} {name} is {}, not {}", shown(shape), shown(axes)));
    }
    Ok(())
}
