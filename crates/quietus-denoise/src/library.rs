//! The C interface of Open Image Denoise 2 (oidn.h), as much of it as is needed, and all `unsafe` code.
//!
//! What keeps it sound: functions are called with the signatures that version 2 declares, which is told by
//! `oidnSetFilterBool`, a name that version 1 does not have; handles are released once, filters before their device,
//! and the device before the library is unloaded, by the order of fields and lifetimes; images are given to a CPU
//! device only, which reads and writes them in place while a filter runs and not after.

use std::ffi::{CStr, c_char, c_int, c_void};
use std::path::Path;
use std::ptr::null;

use libloading::Symbol;

use crate::DenoiseError;

/// What the library is called, most exact first.
#[cfg(target_os = "linux")]
const NAMES: [&str; 2] = ["libOpenImageDenoise.so.2", "libOpenImageDenoise.so"];
#[cfg(target_os = "macos")]
const NAMES: [&str; 3] = [
    "libOpenImageDenoise.2.dylib",
    "libOpenImageDenoise.dylib",
    "/opt/homebrew/lib/libOpenImageDenoise.dylib",
];
#[cfg(not(any(target_os = "linux", target_os = "macos")))]
const NAMES: [&str; 1] = ["OpenImageDenoise.dll"];

/// `OIDN_DEVICE_TYPE_CPU`.
const CPU: c_int = 1;
/// `OIDN_FORMAT_FLOAT3`.
const FLOAT3: c_int = 3;

type Handle = *mut c_void;
type Release = unsafe extern "C" fn(Handle);
type SetImage = unsafe extern "C" fn(
    filter: Handle,
    name: *const c_char,
    pixels: *mut c_void,
    format: c_int,
    width: usize,
    height: usize,
    byte_offset: usize,
    pixel_stride: usize,
    row_stride: usize,
);

/// The functions of a library that stays loaded for as long as they are there.
pub(crate) struct Library {
    new_device: unsafe extern "C" fn(c_int) -> Handle,
    commit_device: unsafe extern "C" fn(Handle),
    release_device: Release,
    device_error: unsafe extern "C" fn(Handle, *mut *const c_char) -> c_int,
    device_int: unsafe extern "C" fn(Handle, *const c_char) -> c_int,
    new_filter: unsafe extern "C" fn(Handle, *const c_char) -> Handle,
    set_image: SetImage,
    set_bool: unsafe extern "C" fn(Handle, *const c_char, bool),
    commit_filter: unsafe extern "C" fn(Handle),
    execute_filter: unsafe extern "C" fn(Handle),
    release_filter: Release,
    _library: libloading::Library,
}

impl Library {
    pub(crate) fn load(path: Option<&Path>) -> Result<Self, DenoiseError> {
        if let Some(path) = path {
            let name = path.display().to_string();
            let library = open(path.as_os_str());
            let library =
                library.map_err(|reason| DenoiseError::Unloadable { path: name.clone(), reason })?;
            return Self::of(library, &name);
        }
        let mut tried = Vec::new();
        for name in NAMES {
            match open(name.as_ref()) {
                Ok(library) => return Self::of(library, name),
                Err(reason) => tried.push(reason),
            }
        }
        Err(DenoiseError::Absent(tried.join("; ")))
    }

    fn of(library: libloading::Library, path: &str) -> Result<Self, DenoiseError> {
        let missing = |reason: String| DenoiseError::NotVersion2 { path: path.to_owned(), reason };
        macro_rules! function {
            ($name:literal) => {{
                // SAFETY: the type is that of the field it goes to, which has the signature oidn.h of version 2
                // declares for this name. The pointer is kept beside the library, and goes with it.
                let symbol: Result<Symbol<'_, _>, _> = unsafe { library.get($name) };
                *symbol.map_err(|_| missing(format!("it lacks {}", String::from_utf8_lossy($name).trim_end_matches('\0'))))?
            }};
        }
        Ok(Self {
            // First: version 1 does not have it, and what it has may differ.
            set_bool: function!(b"oidnSetFilterBool\0"),
            new_device: function!(b"oidnNewDevice\0"),
            commit_device: function!(b"oidnCommitDevice\0"),
            release_device: function!(b"oidnReleaseDevice\0"),
            device_error: function!(b"oidnGetDeviceError\0"),
            device_int: function!(b"oidnGetDeviceInt\0"),
            new_filter: function!(b"oidnNewFilter\0"),
            set_image: function!(b"oidnSetSharedFilterImage\0"),
            commit_filter: function!(b"oidnCommitFilter\0"),
            execute_filter: function!(b"oidnExecuteFilter\0"),
            release_filter: function!(b"oidnReleaseFilter\0"),
            _library: library,
        })
    }

    /// The first error since it was last asked for, of a device or, with null, of the making of one.
    fn error(&self, device: Handle) -> Result<(), DenoiseError> {
        let mut message = null();
        // SAFETY: `device` is null or a live handle; the library sets `message` to null or a text that ends with a
        // zero byte and lives until the next call for this device, after the copy below.
        let code = unsafe { (self.device_error)(device, &raw mut message) };
        if code == 0 {
            return Ok(());
        }
        let text = match message.is_null() {
            true => format!("error {code}"),
            // SAFETY: as above.
            false => unsafe { CStr::from_ptr(message) }.to_string_lossy().into_owned(),
        };
        Err(DenoiseError::Refused(text))
    }
}

fn open(name: &std::ffi::OsStr) -> Result<libloading::Library, String> {
    // SAFETY: loading runs code of the library. It is the one that the user named, or one of that name from where
    // the system keeps libraries: whoever can put another one there can run what they like without us.
    let library = unsafe { libloading::Library::new(name) };
    library.map_err(|error| std::error::Error::source(&error).map_or(error.to_string(), ToString::to_string))
}

/// Pixels under the name that a filter knows them by.
#[derive(Clone, Copy)]
pub(crate) struct Image<'a> {
    pub(crate) name: &'static CStr,
    pub(crate) pixels: &'a [[f32; 3]],
}

/// A device that computes on the CPU.
pub(crate) struct Device<'a> {
    library: &'a Library,
    handle: Handle,
}

/// A filter of a device.
struct Filter<'a> {
    device: &'a Device<'a>,
    handle: Handle,
}

impl<'a> Device<'a> {
    pub(crate) fn new(library: &'a Library) -> Result<Self, DenoiseError> {
        // SAFETY: a plain call; the result is null or a handle of our own.
        let handle = unsafe { (library.new_device)(CPU) };
        if handle.is_null() {
            library.error(handle)?;
            return Err(DenoiseError::Refused("no CPU device can be made".to_owned()));
        }
        let device = Self { library, handle };
        // SAFETY: the handle is live.
        unsafe { (library.commit_device)(handle) };
        library.error(handle)?;
        Ok(device)
    }

    pub(crate) fn version(&self) -> i32 {
        // SAFETY: the handle is live, the name ends with a zero byte.
        unsafe { (self.library.device_int)(self.handle, c"version".as_ptr()) }
    }

    /// Runs a filter for ray-traced pictures over `images`, each of `width * height` pixels.
    pub(crate) fn filter(
        &self,
        [width, height]: [usize; 2],
        images: &[Image<'_>],
        flags: &[(&CStr, bool)],
    ) -> Result<Vec<[f32; 3]>, DenoiseError> {
        assert!(images.iter().all(|image| Some(image.pixels.len()) == width.checked_mul(height)));
        let mut output = vec![[0.0; 3]; width * height];
        let filter = Filter::new(self)?;
        for image in images {
            // The library only reads from it: an input is declared like an output, without `const`.
            filter.set_image(image.name, image.pixels.as_ptr().cast_mut(), width, height);
        }
        filter.set_image(c"output", output.as_mut_ptr(), width, height);
        for (name, value) in flags {
            // SAFETY: the handle is live, the name ends with a zero byte.
            unsafe { (self.library.set_bool)(filter.handle, name.as_ptr(), *value) };
        }
        // SAFETY: the handle is live. The images are all as long as was said (checked above), and live until the
        // filter is released; nobody else looks at `output` while it runs, which is until this returns.
        unsafe {
            (self.library.commit_filter)(filter.handle);
            (self.library.execute_filter)(filter.handle);
        }
        drop(filter);
        self.library.error(self.handle)?;
        Ok(output)
    }
}

impl Drop for Device<'_> {
    fn drop(&mut self) {
        // SAFETY: the handle is live, its filters borrow this and are gone, and it is not used any more.
        unsafe { (self.library.release_device)(self.handle) };
    }
}

impl<'a> Filter<'a> {
    fn new(device: &'a Device<'a>) -> Result<Self, DenoiseError> {
        // SAFETY: the handle is live, the name ends with a zero byte.
        let handle = unsafe { (device.library.new_filter)(device.handle, c"RT".as_ptr()) };
        if handle.is_null() {
            device.library.error(device.handle)?;
            return Err(DenoiseError::Refused("no filter can be made".to_owned()));
        }
        Ok(Self { device, handle })
    }

    /// Names `width * height` pixels, which must live until the filter is run for the last time.
    fn set_image(&self, name: &CStr, pixels: *mut [f32; 3], width: usize, height: usize) {
        // SAFETY: the handle is live, the name ends with a zero byte; nothing is read or written yet. Strides of 0
        // mean: without gaps.
        unsafe {
            let set = self.device.library.set_image;
            set(self.handle, name.as_ptr(), pixels.cast(), FLOAT3, width, height, 0, 0, 0);
        }
    }
}

impl Drop for Filter<'_> {
    fn drop(&mut self) {
        // SAFETY: the handle is live and not used any more.
        unsafe { (self.device.library.release_filter)(self.handle) };
    }
}
