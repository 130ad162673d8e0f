//! Owners of GL objects. An owner cannot be copied, and it deletes its object when dropped, also when an error returns early.

use std::rc::Rc;

use glow::HasContext;

use super::context::{Context, Gpu};
use crate::error::{Error, Result};

/// Owns a GL object.
pub(super) struct Resource<T: Name> {
    name: T,
    context: Rc<Context>,
}

/// Names of GL objects.
pub(super) trait Name: Copy {
    unsafe fn delete(self, gl: &glow::Context);
}

impl<T: Name> Resource<T> {
    /// Owns the object that `create`, a `create_*` call, makes in this context.
    pub fn own(gpu: &Gpu, create: impl FnOnce(&glow::Context) -> Result<T, String>) -> Result<Self> {
        // A lost context makes no objects and gives no reason.
        if gpu.is_lost() {
            gpu.check("making a GL object")?;
        }
        let name = create(gpu.gl()).map_err(|problem| {
            Error::gl(format!("a GL object cannot be made: {problem}"), "free memory or try another device")
        })?;
        Ok(Self { name, context: gpu.context().clone() })
    }

    pub fn name(&self) -> T {
        self.name
    }

    pub fn context(&self) -> &Context {
        &self.context
    }

    pub fn gl(&self) -> &glow::Context {
        self.context.current()
    }
}

impl<T: Name> Drop for Resource<T> {
    fn drop(&mut self) {
        // A lost context has no objects any more.
        if !self.context.is_lost() {
            unsafe { self.name.delete(self.context.current()) }
        }
    }
}

macro_rules! names {
    ($($name:ty => $delete:ident),+ $(,)?) => {
        $(impl Name for $name {
            unsafe fn delete(self, gl: &glow::Context) {
                unsafe { gl.$delete(self) }
            }
        })+
    };
}

names! {
    glow::NativeTexture => delete_texture,
    glow::NativeFramebuffer => delete_framebuffer,
    glow::NativeBuffer => delete_buffer,
    glow::NativeVertexArray => delete_vertex_array,
    glow::NativeProgram => delete_program,
    glow::NativeShader => delete_shader,
    glow::NativeQuery => delete_query,
}
