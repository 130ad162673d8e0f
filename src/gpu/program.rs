//! Shader programs. Sources are embedded, and each draw gives all uniforms.

use std::borrow::Cow;
use std::collections::HashMap;
use std::sync::{LazyLock, PoisonError, RwLock};

use bytemuck::cast_slice;
use glam::{Mat4, Vec3, Vec4};
use glow::HasContext;

use super::context::Gpu;
use super::pace::Pace;
use super::resource::Resource;
use super::texture::Texture;
use crate::error::{Error, Result};

/// A program as text. A line `#include "folder/file.glsl"` is replaced by that file of `glsl/`, the first time that it is compiled in a stage. A define
/// with a value stands for it in the name: `#include "finder/FINDER.glsl"`.
#[derive(Clone, Debug)]
pub struct ShaderSource {
    /// The name for messages.
    pub name: &'static str,
    pub vertex: &'static str,
    pub fragment: &'static str,
    /// Names that are defined in both stages, as `NAME` or `NAME value`. They select variants: software drivers run all branches for all fragments, so a
    /// program should contain only code that its draws need.
    pub defines: Vec<String>,
    /// `(file name, text)` of every file that a source may include.
    pub includes: &'static [(&'static str, &'static str)],
}

/// The value of a uniform. A texture takes the next free unit.
#[derive(Clone, Copy)]
pub enum Uniform<'a> {
    Float(f32),
    Int(i32),
    IVec2([i32; 2]),
    Vec3(Vec3),
    Mat4(Mat4),
    /// The first elements of an array.
    Vec4s(&'a [Vec4]),
    Mat4s(&'a [Mat4]),
    UInts(&'a [u32]),
    Texture(&'a Texture),
    /// A texture array in which shaders write to any texel. The context must support it ([`Gpu::writes_images`]).
    Image(&'a Texture),
}

/// A linked program.
pub struct Program {
    program: Resource<glow::NativeProgram>,
    name: String,
    uniforms: Vec<(String, glow::NativeUniformLocation)>,
    /// The measured cost of its draws.
    pub(super) pace: Pace,
}

/// Texts that replace embedded ones.
static REPLACED: LazyLock<RwLock<HashMap<&'static str, String>>> = LazyLock::new(Default::default);

/// Makes later programs compile `text` in place of an embedded text; `None` restores the embedded one. This serves editing shaders at run time.
pub fn replace_shader_text(embedded: &'static str, text: Option<String>) {
    let mut replaced = REPLACED.write().unwrap_or_else(PoisonError::into_inner);
    match text {
        Some(text) => replaced.insert(embedded, text),
        None => replaced.remove(embedded),
    };
}

fn current(embedded: &'static str) -> Cow<'static, str> {
    let replaced = REPLACED.read().unwrap_or_else(PoisonError::into_inner);
    replaced.get(embedded).map_or(Cow::Borrowed(embedded), |text| Cow::Owned(text.clone()))
}

impl ShaderSource {
    /// Returns (vertex, fragment), both with their includes replaced by the files' texts.
    ///
    /// # Errors
    /// [`Error::Gl`] if an included file does not exist.
    pub fn resolve(&self) -> Result<(String, String)> {
        let stage = |embedded| {
            let text = current(embedded);
            let (version, rest) = text.split_once('\n').unwrap_or((&text, ""));
            let defines: String = self.defines.iter().map(|name| format!("#define {name}\n")).collect();
            Ok(format!("{version}\n{defines}{}", self.resolve_stage(rest)?))
        };
        Ok((stage(self.vertex)?, stage(self.fragment)?))
    }

    /// Whether its shaders write to images, for contexts that [`Gpu::writes_images`].
    pub fn writes_images(&self) -> bool {
        self.fragment.starts_with("#version 420")
    }

    /// The name and the defines.
    fn label(&self) -> String {
        let defines = if self.defines.is_empty() { String::new() } else { format!(" ({})", self.defines.join(", ")) };
        format!("{}{defines}", self.name)
    }

    fn resolve_stage(&self, text: &str) -> Result<String> {
        let mut resolved = String::new();
        for line in text.lines() {
            match line.strip_prefix("#include ") {
                None => resolved.push_str(line),
                Some(file) => {
                    let values = self.defines.iter().filter_map(|define| define.split_once(' '));
                    let file = file.trim().trim_matches('"').to_owned();
                    // The define stands for the whole name of the file.
                    let file = values.fold(file, |file, (name, value)| file.replace(&format!("/{name}."), &format!("/{value}.")));
                    let found = self.includes.iter().find(|(name, _)| *name == file);
                    let (_, text) = found.ok_or_else(|| {
                        Error::gl(format!("shader {} includes {file}, which does not exist", self.name), "report this")
                    })?;
                    let guard = format!("INCLUDED_{}", file.replace(['/', '.'], "_"));
                    let text = self.resolve_stage(&current(text))?;
                    resolved.push_str(&format!("#ifndef {guard}\n#define {guard}\n{text}#endif"));
                }
            }
            resolved.push('\n');
        }
        Ok(resolved)
    }
}

impl Program {
    /// # Errors
    /// [`Error::Gl`] with the driver's log and the numbered source if the program does not compile or link.
    pub fn new(gpu: &Gpu, source: &ShaderSource) -> Result<Self> {
        let gl = gpu.gl();
        let (vertex, fragment) = source.resolve()?;
        let program = Resource::own(gpu, |gl| unsafe { gl.create_program() })?;
        let stages = [(glow::VERTEX_SHADER, &vertex), (glow::FRAGMENT_SHADER, &fragment)];
        let mut shaders = Vec::new();
        for (kind, text) in stages {
            let shader = Resource::own(gpu, |gl| unsafe { gl.create_shader(kind) })?;
            unsafe {
                gl.shader_source(shader.name(), text);
                gl.compile_shader(shader.name());
                if !gl.get_shader_compile_status(shader.name()) {
                    return Err(failure(gpu, source, "compile", &gl.get_shader_info_log(shader.name()), &[text]));
                }
                gl.attach_shader(program.name(), shader.name());
            }
            shaders.push(shader);
        }
        unsafe {
            gl.link_program(program.name());
            if !gl.get_program_link_status(program.name()) {
                let log = gl.get_program_info_log(program.name());
                return Err(failure(gpu, source, "link", &log, &[&vertex, &fragment]));
            }
            let uniforms = (0..gl.get_active_uniforms(program.name()))
                .filter_map(|i| gl.get_active_uniform(program.name(), i))
                .filter_map(|uniform| Some((gl.get_uniform_location(program.name(), &uniform.name)?, uniform.name)))
                // Drivers name an array by its first element.
                .map(|(location, name)| (name.trim_end_matches("[0]").to_owned(), location))
                .collect();
            gpu.check("making a shader program")?;
            Ok(Self { program, name: source.label(), uniforms, pace: Pace::default() })
        }
    }

    /// Makes the program current and sets all of its uniforms.
    ///
    /// # Panics
    /// If `values` lacks a uniform that the shader reads, because then Rust and shader disagree. Values that the shader does not read are
    /// ignored: compilers differ in which uniforms they find unused.
    pub(super) fn bind(&self, values: &[(&'static str, Uniform)]) {
        let gl = self.program.gl();
        unsafe { gl.use_program(Some(self.program.name())) };
        let (mut unit, mut image) = (0, 0);
        for (name, location) in &self.uniforms {
            let (_, value) = values
                .iter()
                .find(|(given, _)| given == name)
                .unwrap_or_else(|| panic!("shader {} reads the uniform {name}, which this draw does not give", self.name));
            let location = Some(location);
            unsafe {
                match *value {
                    Uniform::Float(v) => gl.uniform_1_f32(location, v),
                    Uniform::Int(v) => gl.uniform_1_i32(location, v),
                    Uniform::IVec2([x, y]) => gl.uniform_2_i32(location, x, y),
                    Uniform::Vec3(v) => gl.uniform_3_f32(location, v.x, v.y, v.z),
                    Uniform::Mat4(v) => gl.uniform_matrix_4_f32_slice(location, false, &v.to_cols_array()),
                    Uniform::Vec4s(v) => gl.uniform_4_f32_slice(location, cast_slice(v)),
                    Uniform::Mat4s(v) => gl.uniform_matrix_4_f32_slice(location, false, cast_slice(v)),
                    Uniform::UInts(v) => gl.uniform_1_u32_slice(location, v),
                    Uniform::Texture(texture) => {
                        gl.active_texture(glow::TEXTURE0 + unit);
                        gl.bind_texture(texture.kind, Some(texture.name()));
                        gl.uniform_1_i32(location, unit as i32);
                        unit += 1;
                    }
                    Uniform::Image(texture) => {
                        gl.bind_image_texture(image, Some(texture.name()), 0, true, 0, glow::READ_WRITE, texture.format.gl().0);
                        gl.uniform_1_i32(location, image as i32);
                        image += 1;
                    }
                }
            }
        }
    }
}

fn failure(gpu: &Gpu, source: &ShaderSource, verb: &str, log: &str, texts: &[&String]) -> Error {
    if let (true, Err(lost)) = (gpu.is_lost(), gpu.check("making a shader program")) {
        return lost;
    }
    let mut numbered = String::new();
    for text in texts {
        for (number, line) in (1..).zip(text.lines()) {
            numbered.push_str(&format!("\n{number:4} {line}"));
        }
    }
    Error::gl(
        format!("shader {} does not {verb} on {}:\n{}{numbered}", source.label(), gpu.info().renderer, log.trim()),
        "try another device or driver (--gl-device, --backend), and report this",
    )
}
