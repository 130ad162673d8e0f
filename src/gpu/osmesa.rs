//! OSMesa, an alternative to EGL. It is loaded at run time and never linked, because Mesa dropped it in version 25.1.

use std::cell::UnsafeCell;
use std::ffi::{CString, c_char, c_int, c_void};

use libloading::Library;

const LIBRARIES: [&str; 3] = ["libOSMesa.so.8", "libOSMesa.so.6", "libOSMesa.so"];

// From GL/osmesa.h.
const FORMAT: c_int = 0x22;
const DEPTH_BITS: c_int = 0x30;
const PROFILE: c_int = 0x33;
const CORE_PROFILE: c_int = 0x34;
const CONTEXT_MAJOR_VERSION: c_int = 0x36;
const CONTEXT_MINOR_VERSION: c_int = 0x37;

type Handle = *mut c_void;
type CreateContextAttribs = unsafe extern "C" fn(*const c_int, Handle) -> Handle;
type MakeCurrent = unsafe extern "C" fn(Handle, *mut c_void, u32, c_int, c_int) -> u8;
type GetProcAddress = unsafe extern "C" fn(*const c_char) -> *const c_void;
type DestroyContext = unsafe extern "C" fn(Handle);

/// A context that renders into memory. OSMesa needs a default framebuffer. One pixel is enough, because all draws go to our own targets.
pub(super) struct OsMesa {
    handle: Handle,
    pixel: Box<UnsafeCell<[u8; 4]>>,
    make_current: MakeCurrent,
    get_proc_address: GetProcAddress,
    destroy_context: DestroyContext,
    /// The last field, so that the library is unloaded after the context is destroyed.
    _library: Library,
}

impl OsMesa {
    /// Makes a 3.3 core context and leaves it current.
    pub fn new() -> Result<Self, String> {
        let library = LIBRARIES
            .iter()
            .find_map(|name| unsafe { Library::new(name) }.ok())
            .ok_or_else(|| format!("none of {} is installed", LIBRARIES.join(", ")))?;
        let attributes = [
            [FORMAT, glow::RGBA as c_int],
            [DEPTH_BITS, 0],
            [PROFILE, CORE_PROFILE],
            [CONTEXT_MAJOR_VERSION, 3],
            [CONTEXT_MINOR_VERSION, 3],
            [0, 0],
        ];
        let context = unsafe {
            let create: CreateContextAttribs = symbol(&library, "OSMesaCreateContextAttribs")?;
            let handle = create(attributes.as_ptr().cast(), std::ptr::null_mut());
            if handle.is_null() {
                return Err("the library refuses a 3.3 core context".into());
            }
            Self {
                handle,
                pixel: Box::default(),
                make_current: symbol(&library, "OSMesaMakeCurrent")?,
                get_proc_address: symbol(&library, "OSMesaGetProcAddress")?,
                destroy_context: symbol(&library, "OSMesaDestroyContext")?,
                _library: library,
            }
        };
        context.make_current()?;
        Ok(context)
    }

    pub fn make_current(&self) -> Result<(), String> {
        match unsafe { (self.make_current)(self.handle, self.pixel.get().cast(), glow::UNSIGNED_BYTE, 1, 1) } {
            0 => {
                unsafe { (self.make_current)(std::ptr::null_mut(), std::ptr::null_mut(), 0, 0, 0) };
                Err("the context cannot be made current".into())
            }
            _ => Ok(()),
        }
    }

    pub fn function(&self, name: &str) -> *const c_void {
        CString::new(name).map_or(std::ptr::null(), |name| unsafe { (self.get_proc_address)(name.as_ptr()) })
    }
}

impl Drop for OsMesa {
    fn drop(&mut self) {
        unsafe { (self.destroy_context)(self.handle) }
    }
}

/// `T` must be the function's type.
unsafe fn symbol<T: Copy>(library: &Library, name: &str) -> Result<T, String> {
    unsafe { library.get::<T>(name.as_bytes()) }.map(|symbol| *symbol).map_err(|_| format!("the library has no {name}"))
}
