//! Files written here and read back.

use super::*;

/// A field to be written.
struct Field(&'static str, Vec<u64>, Vec<f32>);

fn file(fields: &[Field]) -> Vec<u8> {
    let mut head = b"tensor_file\0\x01\x00".to_vec();
    head.extend((fields.len() as u32).to_le_bytes());
    let length: usize = fields.iter().map(|Field(name, shape, _)| 13 + name.len() + 8 * shape.len()).sum();
    let (mut start, mut content) = (head.len() + length, Vec::new());
    for Field(name, shape, numbers) in fields {
        head.extend((name.len() as u16).to_le_bytes());
        head.extend(name.bytes());
        head.extend((shape.len() as u16).to_le_bytes());
        head.push(10);
        head.extend((start as u64).to_le_bytes());
        shape.iter().for_each(|n| head.extend(n.to_le_bytes()));
        numbers.iter().for_each(|number| content.extend(number.to_le_bytes()));
        start += 4 * numbers.len();
    }
    [head, content].concat()
}

fn fields() -> Vec<Field> {
    let ramp = |n: usize| (0..n).map(|i| i as f32).collect::<Vec<_>>();
    vec![
        Field("theta_i", vec![2], vec![0.0, 1.5]),
        Field("phi_i", vec![1], vec![0.0]),
        Field("wavelengths", vec![3], vec![400.0, 500.0, 600.0]),
        Field("ndf", vec![2, 3], ramp(6)),
        Field("sigma", vec![3, 2], vec![1.0; 6]),
        Field("vndf", vec![1, 2, 2, 2], vec![1.0; 8]),
        Field("luminance", vec![1, 2, 2, 2], vec![2.0; 8]),
        Field("spectra", vec![1, 2, 3, 2, 2], ramp(24)),
    ]
}

/// Takes wavelengths for channels.
fn channels(wavelengths: &[f32]) -> Vec<Vec3> {
    assert_eq!(wavelengths, [400.0, 500.0, 600.0]);
    vec![Vec3::X, Vec3::Y, Vec3::Z]
}

fn read_fields(fields: &[Field]) -> Result<Measured, SceneError> {
    read(Path::new("a.bsdf"), &file(fields), channels)
}

#[test]
fn materials_come_back_as_they_were_written() {
    let read = read_fields(&fields()).expect("sound");
    assert_eq!((read.azimuths, read.polar_angles), (vec![0.0], vec![0.0, 1.5]));
    assert_eq!((read.facets.size, read.facets.values[4]), ([3, 2], 4.0));
    assert_eq!(read.area.size, [2, 3]);
    // Numbers 5, 9 and 13 + 4 of view 0 and 1: place 1 of each wavelength.
    assert_eq!(read.colors.values[1], Vec3::new(1.0, 5.0, 9.0));
    assert_eq!(read.colors.values[4], Vec3::new(12.0, 16.0, 20.0));
}

#[test]
fn what_is_wrong_is_said() {
    let said = |spoil: &dyn Fn(&mut Vec<Field>)| {
        let mut fields = fields();
        spoil(&mut fields);
        read_fields(&fields).expect_err("spoilt").to_string()
    };
    assert!(said(&|f| drop(f.pop())).contains("\"spectra\": is expected"));
    assert!(said(&|f| f[3].1 = vec![6]).contains("in 1 dimensions"));
    assert!(said(&|f| f[3].1 = vec![6, 1]).contains("2 or more along two others"));
    assert!(said(&|f| f[5].1 = vec![2, 1, 2, 2]).contains("dimensions [2, 1, 2, 2], expected [1, 2]"));
    assert!(said(&|f| f[7].1[0] = 9).contains("bytes are expected"));
    assert!(said(&|f| f[7].1[0] = u64::MAX).contains("numbers"));
    assert!(said(&|f| f[4].2[0] = f32::NAN).contains("number 0 is NaN"));
    assert!(said(&|f| f[5].2 = vec![0.0; 8]).contains("is 0 everywhere"));
    assert!(said(&|f| f[0].2 = vec![1.0, 0.0]).contains("expected to ascend"));
    let half = |f: &mut Vec<Field>| {
        f[1] = Field("phi_i", vec![3], vec![0.0, 1.0, 2.0]);
    };
    assert!(said(&half).contains("a part of all azimuths"));
    let short = file(&fields());
    for length in 0..short.len() {
        assert!(read(Path::new("a.bsdf"), &short[..length], channels).is_err(), "{length} bytes");
    }
    assert!(read(Path::new("a.bsdf"), b"tensor_file\0\x02\x00\x00\x00\x00\x00", channels).is_err());
}
