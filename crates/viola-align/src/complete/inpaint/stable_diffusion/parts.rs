//! The networks of a pipeline: opened, checked against each other, and run.

use super::settings::Latents;
use crate::complete::inpaint::InpaintError;
use std::path::Path;
use std::sync::Arc;
use viola_network as network;
use viola_network::manifest::Input;
use viola_network::signature::{expect, one};
use viola_network::{Data, Element, Network, RuntimeParams, Tensor};
use viola_reconstruct::label::numbers::all_finite;
use viola_reconstruct::label::picture::Raster;

/// Allowed sides of a pipeline's pictures, in pixels.
const SIDES: std::ops::RangeInclusive<usize> = 8..=2048;

/// The networks, and the sizes that they agree on.
pub(super) struct Parts {
    encoder: Arc<Network>,
    unet: Arc<Network>,
    decoder: Arc<Network>,
    /// Size of the picture, in pixels.
    pub(super) size: Raster,
    channels: usize,
    /// Size of the latents.
    rows: usize,
    columns: usize,
}

/// Opens one of the networks in a pipeline's folder.
pub(super) fn open(folder: &Path, name: &str, params: &RuntimeParams) -> Result<Arc<Network>, InpaintError> {
    network::open(&folder.join(name), params).map_err(|error| InpaintError::Open(error.to_string()))
}

/// Checks a network's inputs and outputs; each is a name, its element type and its axes.
fn is(network: &Network, name: &str, inputs: &[Port], outputs: &[Port]) -> Result<(), String> {
    for (what, infos, ports) in [("input", network.inputs(), inputs), ("output", network.outputs(), outputs)]
    {
        for (port, element, axes) in ports {
            let info = one(infos, Some(port), what).map_err(|problem| format!("{name}: {problem}"))?;
            expect(info, what, *element, axes).map_err(|problem| format!("{name}: {problem}"))?;
        }
        if infos.len() != ports.len() {
            return Err(format!("{name} has {} {what}s, not {}", infos.len(), ports.len()));
        }
    }
    Ok(())
}

type Port<'a> = (&'a str, Element, &'a [Option<usize>]);

/// Returns the text encoder's embedding of a prompt's tokens, 1 x length to 1 x length x width.
pub(super) fn embed(encoder: &Network, tokens: Vec<i64>) -> Result<Tensor, InpaintError> {
    let length = tokens.len();
    let input = Tensor { shape: vec![1, length], data: Data::I64(tokens) };
    let [embeds] = encoder.run(&[("input_ids", input)], ["prompt_embeds"])?;
    match (embeds.shape.as_slice(), embeds.as_f32()) {
        (&[1, rows, width], Some(values)) if rows == length && values.len() == rows * width => Ok(embeds),
        _ => Err(wrong(&embeds, &format!("[1, {length}, width]"))),
    }
}

/// Checks that a network is a text encoder for `length` tokens.
pub(super) fn is_text_encoder(encoder: &Network, length: usize) -> Result<(), String> {
    let input: Port = ("input_ids", Element::I64, &[Some(1), Some(length)]);
    let output: Port = ("prompt_embeds", Element::F32, &[Some(1), Some(length), None]);
    is(encoder, "text_encoder.onnx", &[input], &[output])
}

impl Parts {
    /// Opens the networks for pictures, and checks that they fit each other and prompts of this shape.
    pub(super) fn open(
        folder: &Path,
        params: &RuntimeParams,
        input: &Input,
        latents: &Latents,
        prompt: &[usize],
        misfit: impl Fn(String) -> InpaintError,
    ) -> Result<Parts, InpaintError> {
        let encoder = open(folder, "vae_encoder.onnx", params)?;
        let unet = open(folder, "unet.onnx", params)?;
        let decoder = open(folder, "vae_decoder.onnx", params)?;
        let shape = one(encoder.inputs(), Some("picture"), "input").map_err(&misfit)?;
        let (Some(height), Some(width)) =
            (input.height.pixels().or(shape.axis(2)), input.width.pixels().or(shape.axis(3)))
        else {
            return Err(misfit("vae_encoder.onnx is not made for pictures of one size".to_owned()));
        };
        let whole = |side: usize| SIDES.contains(&side) && side.is_multiple_of(latents.cell);
        if !whole(width) || !whole(height) {
            return Err(misfit(format!("it is made for pictures of {width} x {height} pixels")));
        }
        let (channels, rows, columns) = (latents.channels, height / latents.cell, width / latents.cell);
        let of = |channels: usize| [Some(1), Some(channels), Some(rows), Some(columns)];
        let picture = [Some(1), Some(3), Some(height), Some(width)];
        let prompt: Vec<Option<usize>> = prompt.iter().map(|n| Some(*n)).collect();
        let f32 = Element::F32;
        is(
            &encoder,
            "vae_encoder.onnx",
            &[("picture", f32, &picture)],
            &[("mean", f32, &of(channels)), ("std", f32, &of(channels))],
        )
        .map_err(&misfit)?;
        is(
            &unet,
            "unet.onnx",
            &[
                ("sample", f32, &of(2 * channels + 1)),
                ("timestep", f32, &[Some(1)]),
                ("prompt_embeds", f32, &prompt),
            ],
            &[("prediction", f32, &of(channels))],
        )
        .map_err(&misfit)?;
        is(&decoder, "vae_decoder.onnx", &[("latents", f32, &of(channels))], &[("picture", f32, &picture)])
            .map_err(&misfit)?;
        Ok(Parts { encoder, unet, decoder, size: Raster { width, height }, channels, rows, columns })
    }

    /// Returns the number of one picture's latents.
    pub(super) fn latents(&self) -> usize {
        self.channels * self.rows * self.columns
    }

    /// Returns mean and standard deviation of a picture's latents.
    pub(super) fn encode(&self, picture: Tensor) -> Result<(Vec<f32>, Vec<f32>), InpaintError> {
        let [mean, std] = self.encoder.run(&[("picture", picture)], ["mean", "std"])?;
        let shape = [1, self.channels, self.rows, self.columns];
        Ok((numbers(mean, &shape)?, numbers(std, &shape)?))
    }

    /// Returns the U-Net's prediction for `latents`, the mask and the masked picture's latents.
    pub(super) fn predict(
        &self,
        latents: &[f32],
        mask: &[f32],
        masked: &[f32],
        timestep: f64,
        prompt: &Tensor,
    ) -> Result<Vec<f32>, InpaintError> {
        let sample = Tensor::f32(
            [1, 2 * self.channels + 1, self.rows, self.columns],
            [latents, mask, masked].concat(),
        );
        let timestep = Tensor::f32([1], vec![timestep as f32]);
        let inputs = [("sample", sample), ("timestep", timestep), ("prompt_embeds", prompt.clone())];
        let [prediction] = self.unet.run(&inputs, ["prediction"])?;
        numbers(prediction, &[1, self.channels, self.rows, self.columns])
    }

    /// Returns the picture of some latents, from -1 to 1, 3 x height x width.
    pub(super) fn decode(&self, latents: Vec<f32>) -> Result<Vec<f32>, InpaintError> {
        let latents = Tensor::f32([1, self.channels, self.rows, self.columns], latents);
        let [picture] = self.decoder.run(&[("latents", latents)], ["picture"])?;
        numbers(picture, &[1, 3, self.size.height, self.size.width])
    }

    pub(super) fn runtime(&self) -> &str {
        self.unet.runtime()
    }
}

/// Returns the finite numbers of a tensor of this shape.
fn numbers(tensor: Tensor, shape: &[usize]) -> Result<Vec<f32>, InpaintError> {
    let count: usize = shape.iter().product();
    if tensor.shape != shape || tensor.data.len() != count {
        return Err(wrong(&tensor, &format!("{shape:?}")));
    }
    match tensor.data {
        Data::F32(values) if all_finite(&values) => Ok(values),
        Data::F32(_) => Err(InpaintError::NotFinite),
        data => Err(InpaintError::Shape { got: format!("{:?}", data.element()), want: "F32".to_owned() }),
    }
}

fn wrong(tensor: &Tensor, want: &str) -> InpaintError {
    let got = format!("{:?} {:?}", tensor.data.element(), tensor.shape);
    InpaintError::Shape { got, want: format!("F32 {want}") }
}
