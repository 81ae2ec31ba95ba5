//! Stands in for Open Image Denoise in tests: checks how it is called, and makes each pixel of the output the sum of
//! the images it was given, so that a test sees which ones those were. A guide that was filtered before comes doubled.

use std::collections::BTreeMap;
use std::ffi::{CStr, c_char, c_int, c_void};

#[derive(Default)]
struct Filter {
    images: BTreeMap<String, (*mut [f32; 3], usize)>,
    flags: BTreeMap<String, bool>,
    is_committed: bool,
}

#[derive(Default)]
struct Device {
    is_committed: bool,
    has_failed: bool,
}

#[unsafe(no_mangle)]
extern "C" fn oidnNewDevice(kind: c_int) -> *mut Device {
    assert_eq!(kind, 1, "a CPU device");
    Box::into_raw(Box::default())
}

#[unsafe(no_mangle)]
unsafe extern "C" fn oidnCommitDevice(device: *mut Device) {
    unsafe { (*device).is_committed = true };
}

#[unsafe(no_mangle)]
unsafe extern "C" fn oidnReleaseDevice(device: *mut Device) {
    drop(unsafe { Box::from_raw(device) });
}

#[unsafe(no_mangle)]
unsafe extern "C" fn oidnGetDeviceError(device: *mut Device, message: *mut *const c_char) -> c_int {
    let failed = !device.is_null() && std::mem::take(unsafe { &mut (*device).has_failed });
    if failed {
        unsafe { *message = c"too wide for a stub".as_ptr() };
    }
    c_int::from(failed)
}

#[unsafe(no_mangle)]
unsafe extern "C" fn oidnGetDeviceInt(_: *mut Device, name: *const c_char) -> c_int {
    assert_eq!(unsafe { CStr::from_ptr(name) }, c"version");
    20_099
}

#[unsafe(no_mangle)]
unsafe extern "C" fn oidnNewFilter(device: *mut Device, kind: *const c_char) -> *mut (*mut Device, Filter) {
    assert!(unsafe { (*device).is_committed } && unsafe { CStr::from_ptr(kind) } == c"RT");
    Box::into_raw(Box::new((device, Filter::default())))
}

#[unsafe(no_mangle)]
unsafe extern "C" fn oidnSetSharedFilterImage(
    filter: *mut (*mut Device, Filter),
    name: *const c_char,
    pixels: *mut c_void,
    format: c_int,
    width: usize,
    height: usize,
    offset: usize,
    pixel_stride: usize,
    row_stride: usize,
) {
    assert_eq!((format, offset, pixel_stride, row_stride), (3, 0, 0, 0));
    let name = unsafe { CStr::from_ptr(name) }.to_str().unwrap().to_owned();
    unsafe { (*filter).1.images.insert(name, (pixels.cast(), width * height)) };
    if width > 100 {
        unsafe { (*(*filter).0).has_failed = true };
    }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn oidnSetFilterBool(filter: *mut (*mut Device, Filter), name: *const c_char, value: bool) {
    let name = unsafe { CStr::from_ptr(name) }.to_str().unwrap().to_owned();
    unsafe { (*filter).1.flags.insert(name, value) };
}

#[unsafe(no_mangle)]
unsafe extern "C" fn oidnCommitFilter(filter: *mut (*mut Device, Filter)) {
    unsafe { (*filter).1.is_committed = true };
}

#[unsafe(no_mangle)]
unsafe extern "C" fn oidnExecuteFilter(filter: *mut (*mut Device, Filter)) {
    let (_, filter) = unsafe { &*filter };
    assert!(filter.is_committed);
    let is_main = filter.images.contains_key("color");
    assert_eq!(filter.flags.get("hdr").copied().unwrap_or_default(), is_main);
    assert_eq!(
        filter.flags.get("cleanAux").copied().unwrap_or_default(),
        is_main && filter.images.contains_key("albedo")
    );
    let (output, count) = filter.images["output"];
    for pixel in 0..count {
        let inputs = filter.images.iter().filter(|(name, _)| *name != "output");
        let sum = inputs.fold([0.0; 3], |sum, (_, (image, _))| {
            let value = unsafe { *image.add(pixel) };
            [0, 1, 2].map(|c| sum[c] + value[c])
        });
        let factor = if is_main { 1.0 } else { 2.0 };
        unsafe { *output.add(pixel) = sum.map(|value| factor * value) };
    }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn oidnReleaseFilter(filter: *mut (*mut Device, Filter)) {
    drop(unsafe { Box::from_raw(filter) });
}
