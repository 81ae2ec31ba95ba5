//! As much of Embree 3's C interface as the comparison needs, loaded at run time.

use std::ffi::{CStr, c_char, c_int, c_uint, c_void};
use std::ptr::null_mut;
use std::sync::atomic::{AtomicIsize, Ordering};

use glam::Vec3;
use libloading::{Library, Symbol};
use quietus_trace::bvh::Ray;
use quietus_trace::desc::Mesh;

type Handle = *mut c_void;

const FORMAT_UINT3: c_int = 0x5003;
const FORMAT_FLOAT3: c_int = 0x9003;
const BUFFER_INDEX: c_int = 0;
const BUFFER_VERTEX: c_int = 1;
const GEOMETRY_TRIANGLE: c_int = 0;
const SCENE_ROBUST: c_int = 1 << 2;
const NOTHING: u32 = u32::MAX;

/// `RTCRayHit`.
#[derive(Clone, Copy)]
#[repr(C, align(16))]
struct RayHit {
    origin: [f32; 3],
    t_min: f32,
    direction: [f32; 3],
    time: f32,
    t_max: f32,
    mask: u32,
    id: u32,
    flags: u32,
    normal: [f32; 3],
    u: f32,
    v: f32,
    primitive: u32,
    geometry: u32,
    instance: u32,
}

impl RayHit {
    fn new(ray: &Ray) -> Self {
        Self {
            origin: ray.origin.to_array(),
            t_min: ray.t_min,
            direction: ray.direction.to_array(),
            time: 0.0,
            t_max: ray.t_max,
            mask: u32::MAX,
            id: 0,
            flags: 0,
            normal: [0.0; 3],
            u: 0.0,
            v: 0.0,
            primitive: NOTHING,
            geometry: NOTHING,
            instance: NOTHING,
        }
    }
}

/// `RTCIntersectContext`, with room for the fields that some builds have.
#[repr(C)]
struct Context {
    flags: c_uint,
    filter: *mut c_void,
    instance: c_uint,
    room: [c_uint; 15],
}

type Query = unsafe extern "C" fn(Handle, *mut Context, *mut RayHit);

static BYTES: AtomicIsize = AtomicIsize::new(0);

extern "C" fn count_bytes(_: *mut c_void, bytes: isize, _post: bool) -> bool {
    // Relaxed: a sum, read after the build.
    BYTES.fetch_add(bytes, Ordering::Relaxed);
    true
}

/// The library and a device.
pub(crate) struct Embree {
    /// Never unloaded: its worker threads may still be on their way out when the device is gone.
    library: &'static Library,
    device: Handle,
}

impl Embree {
    /// With that many threads for building.
    pub(crate) fn new(threads: usize) -> Result<Self, libloading::Error> {
        // SAFETY: Embree's initialisers are sound to run, and the signatures below are those of its header.
        unsafe {
            let library: &Library = Box::leak(Box::new(Library::new("libembree3.so.3")?));
            let new_device: Symbol<unsafe extern "C" fn(*const c_char) -> Handle> =
                library.get(b"rtcNewDevice\0")?;
            let config = format!("threads={threads},user_threads=0\0");
            let config = CStr::from_bytes_with_nul(config.as_bytes()).expect("ends with nul");
            let device = new_device(config.as_ptr());
            assert!(!device.is_null(), "rtcNewDevice failed");
            let monitor: Symbol<
                unsafe extern "C" fn(Handle, extern "C" fn(*mut c_void, isize, bool) -> bool, Handle),
            > = library.get(b"rtcSetDeviceMemoryMonitorFunction\0")?;
            monitor(device, count_bytes, null_mut());
            Ok(Self { library, device })
        }
    }

    fn get<T>(&self, name: &str) -> Symbol<'_, T> {
        // SAFETY: callers give the type that the header declares.
        unsafe { self.library.get(name.as_bytes()).expect("Embree 3 has this function") }
    }

    /// A scene of one mesh, built in the medium quality, which is the default.
    pub(crate) fn scene<'a>(&'a self, mesh: &'a Mesh, robust: bool) -> Scene<'a> {
        type Make = unsafe extern "C" fn(Handle) -> Handle;
        type Share = unsafe extern "C" fn(Handle, c_int, c_uint, c_int, *const c_void, usize, usize, usize);
        let before = BYTES.load(Ordering::Relaxed);
        // SAFETY: the signatures are the header's. The buffers live as long as the scene, by its lifetime.
        // Embree reads 16 bytes at the last vertex; `positions` is copied with a spare one.
        unsafe {
            let scene = self.get::<Make>("rtcNewScene")(self.device);
            if robust {
                self.get::<unsafe extern "C" fn(Handle, c_int)>("rtcSetSceneFlags")(scene, SCENE_ROBUST);
            }
            let new_geometry: Symbol<unsafe extern "C" fn(Handle, c_int) -> Handle> =
                self.get("rtcNewGeometry");
            let geometry = new_geometry(self.device, GEOMETRY_TRIANGLE);
            let share: Symbol<Share> = self.get("rtcSetSharedGeometryBuffer");
            let mut positions = mesh.positions.clone();
            positions.push(Vec3::ZERO);
            let vertices = positions.as_ptr().cast();
            share(geometry, BUFFER_VERTEX, 0, FORMAT_FLOAT3, vertices, 0, 12, mesh.positions.len());
            let indices = mesh.triangles.as_ptr().cast();
            share(geometry, BUFFER_INDEX, 0, FORMAT_UINT3, indices, 0, 12, mesh.triangles.len());
            self.get::<unsafe extern "C" fn(Handle)>("rtcCommitGeometry")(geometry);
            self.get::<unsafe extern "C" fn(Handle, Handle) -> c_uint>("rtcAttachGeometry")(scene, geometry);
            self.get::<unsafe extern "C" fn(Handle)>("rtcReleaseGeometry")(geometry);
            let start = std::time::Instant::now();
            self.get::<unsafe extern "C" fn(Handle)>("rtcCommitScene")(scene);
            let build_seconds = start.elapsed().as_secs_f64();
            let bytes = BYTES.load(Ordering::Relaxed) - before;
            Scene {
                embree: self,
                scene,
                closest: *self.get("rtcIntersect1"),
                occluded: *self.get("rtcOccluded1"),
                build_seconds,
                bytes,
                _positions: positions,
            }
        }
    }
}

/// A built scene.
pub(crate) struct Scene<'a> {
    embree: &'a Embree,
    scene: Handle,
    closest: Query,
    occluded: Query,
    pub(crate) build_seconds: f64,
    pub(crate) bytes: isize,
    _positions: Vec<Vec3>,
}

impl Scene<'_> {
    /// Traces all rays and returns how many hit.
    pub(crate) fn count_hits(&self, rays: &[Ray], shadow: bool) -> usize {
        let mut context = Context { flags: 0, filter: null_mut(), instance: NOTHING, room: [0; 15] };
        let trace = |ray: &&Ray| {
            let mut hit = RayHit::new(ray);
            // SAFETY: the scene is built; both structures are laid out as the header says. An occlusion query
            // uses the ray alone and sets its end to minus infinity where it hits.
            unsafe {
                let query = if shadow { self.occluded } else { self.closest };
                query(self.scene, &mut context, &mut hit);
            }
            if shadow { hit.t_max == f32::NEG_INFINITY } else { hit.geometry != NOTHING }
        };
        rays.iter().filter(trace).count()
    }
}

impl Drop for Scene<'_> {
    fn drop(&mut self) {
        // SAFETY: made by this device, released once.
        unsafe { self.embree.get::<unsafe extern "C" fn(Handle)>("rtcReleaseScene")(self.scene) }
    }
}

impl Drop for Embree {
    fn drop(&mut self) {
        // SAFETY: made by this library, released once, after all scenes, which borrow it.
        unsafe { self.get::<unsafe extern "C" fn(Handle)>("rtcReleaseDevice")(self.device) }
    }
}
