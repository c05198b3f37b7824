//! A mesh as USDZ (Pixar, "Usdz File Format Specification"): a stored zip of USD as text, with a Mesh for each part, y up,
//! in metres, and of a picture with the colours.

use super::parts::Part;
use super::texture::Texture;
use super::{Mesh, bounds};
use crate::gltf::y_up;
use crate::light::linear;
use std::fmt::Write as _;
use std::io::{Cursor, Write as _};
use zip::write::SimpleFileOptions;

/// The specification aligns files to 64 bytes, so that they can be mapped into memory.
const ALIGNMENT: u16 = 64;

impl Mesh {
    /// Returns the mesh as USDZ, with a mesh for each part and its colours as a picture.
    pub fn usdz(&self) -> Vec<u8> {
        let options = SimpleFileOptions::default()
            .compression_method(zip::CompressionMethod::Stored)
            .with_alignment(ALIGNMENT)
            .last_modified_time(zip::DateTime::default());
        let texture = Texture::new(self.triangles.len());
        let mut archive = zip::ZipWriter::new(Cursor::new(Vec::new()));
        // Readers open the first file.
        let written = archive
            .start_file("home.usda", options)
            .and_then(|()| Ok(archive.write_all(stage(self, &texture).as_bytes())?))
            .and_then(|()| archive.start_file("colors.png", options))
            .and_then(|()| Ok(archive.write_all(&texture.png(self))?))
            .and_then(|()| archive.finish());
        // Writing to memory fails only for sizes beyond the format's 4 GB.
        written.map(Cursor::into_inner).unwrap_or_default()
    }
}

fn stage(mesh: &Mesh, texture: &Texture) -> String {
    let mut out = String::from(
        "#usda 1.0\n(\n    defaultPrim = \"home\"\n    metersPerUnit = 1\n    upAxis = \"Y\"\n)\n\ndef Xform \"home\" (\n    kind = \"component\"\n)\n{\n",
    );
    out.push_str(LOOK);
    let mut names: Vec<String> = Vec::new();
    for part in &mesh.parts {
        let mut name = identifier(&part.name);
        while names.contains(&name) {
            name.push('_');
        }
        write_part(&mut out, mesh, texture, part, &name);
        names.push(name);
    }
    out.push_str("}\n");
    out
}

/// The material: the picture as light that the surface emits. It reflects nothing (black, the index of refraction of air),
/// because the recording's light is in the colours already.
const LOOK: &str = r#"    def Material "look"
    {
        token outputs:surface.connect = </home/look/surface.outputs:surface>

        def Shader "surface"
        {
            uniform token info:id = "UsdPreviewSurface"
            color3f inputs:diffuseColor = (0, 0, 0)
            color3f inputs:emissiveColor.connect = </home/look/colors.outputs:rgb>
            float inputs:ior = 1
            float inputs:roughness = 1
            token outputs:surface
        }

        def Shader "colors"
        {
            uniform token info:id = "UsdUVTexture"
            asset inputs:file = @colors.png@
            token inputs:sourceColorSpace = "sRGB"
            float2 inputs:st.connect = </home/look/places.outputs:result>
            token inputs:wrapS = "clamp"
            token inputs:wrapT = "clamp"
            float3 outputs:rgb
        }

        def Shader "places"
        {
            uniform token info:id = "UsdPrimvarReader_float2"
            string inputs:varname = "st"
            float2 outputs:result
        }
    }

"#;

/// Returns a name as USD allows it: letters, digits and underscores, no digit first.
fn identifier(name: &str) -> String {
    let mut out: String = name.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '_' }).collect();
    if out.chars().next().is_none_or(|first| first.is_ascii_digit()) {
        out.insert(0, '_');
    }
    out
}

fn write_part(out: &mut String, mesh: &Mesh, texture: &Texture, part: &Part, name: &str) {
    let triangles = &mesh.triangles[part.triangles.clone()];
    let vertices = &mesh.vertices[part.vertices.clone()];
    let list = |items: &mut dyn Iterator<Item = String>| items.collect::<Vec<_>>().join(", ");
    let triple = |[x, y, z]: [f32; 3]| format!("({x:.4}, {y:.4}, {z:.4})");
    let [low, high] = bounds(vertices);
    let counts = list(&mut triangles.iter().map(|_| "3".to_owned()));
    let indices = list(
        &mut triangles.iter().flatten().map(|vertex| (*vertex as usize - part.vertices.start).to_string()),
    );
    let points = list(&mut vertices.iter().map(|vertex| triple(y_up(vertex.position_m))));
    let colors = list(&mut vertices.iter().map(|vertex| triple(vertex.color.map(|c| linear(c) as f32))));
    let corners = part.triangles.clone().flat_map(|triangle| texture.corners(triangle));
    let places = list(&mut corners.map(|[s, t]| format!("({s:.5}, {t:.5})")));
    // A surface that reflects nothing needs no normals. Programs without the material show `displayColor`.
    // Writing to a String cannot fail.
    let _ = write!(
        out,
        "    def Mesh \"{name}\" (\n        prepend apiSchemas = [\"MaterialBindingAPI\"]\n    )\n    {{\n        uniform bool doubleSided = 1\n        float3[] extent = [{}, {}]\n        int[] faceVertexCounts = [{counts}]\n        int[] faceVertexIndices = [{indices}]\n        rel material:binding = </home/look>\n        point3f[] points = [{points}]\n        color3f[] primvars:displayColor = [{colors}] (\n            interpolation = \"vertex\"\n        )\n        texCoord2f[] primvars:st = [{places}] (\n            interpolation = \"faceVarying\"\n        )\n        uniform token subdivisionScheme = \"none\"\n        custom string viola:class = \"{}\"\n    }}\n\n",
        triple(low),
        triple(high),
        part.class.name(),
    );
}
