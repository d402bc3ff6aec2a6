//! Holds the bindings against the C compiler: sizes, alignments and offsets of the structs that cross the border,
//! and the values of the constants in use. A wrong layout lets the library write past the end of a packet.

use embree4_sys::*;
use std::fmt::Write;
use std::mem::{align_of, offset_of, size_of};
use std::process::Command;

/// Facts about the bindings, one a line, and a C program that prints the same lines for the headers.
#[derive(Default)]
struct Facts {
    rust: String,
    c: String,
}

impl Facts {
    fn add(&mut self, name: &str, c_expression: &str, value: i64) {
        writeln!(self.rust, "{name} {value}").expect("a String takes all text");
        writeln!(self.c, "printf(\"{name} %lld\\n\", (long long)({c_expression}));")
            .expect("a String takes all text");
    }
}

macro_rules! structs {
    ($facts:ident, $($name:ident { $($member:ident),* })*) => { $(
        let c_name = concat!("struct ", stringify!($name));
        $facts.add(concat!("sizeof ", stringify!($name)), &format!("sizeof({c_name})"), size_of::<$name>() as i64);
        $facts.add(
            concat!("alignof ", stringify!($name)), &format!("_Alignof({c_name})"), align_of::<$name>() as i64,
        );
        $(
            $facts.add(
                concat!("offsetof ", stringify!($name), ".", stringify!($member)),
                &format!("offsetof({c_name}, {})", stringify!($member)),
                offset_of!($name, $member) as i64,
            );
        )*
    )* };
}

macro_rules! values {
    ($facts:ident, $($name:ident)*) => { $(
        $facts.add(stringify!($name), stringify!($name), i64::from($name));
    )* };
}

fn facts() -> Facts {
    let mut facts = Facts::default();
    structs! { facts,
        RTCRay { org_x, org_y, org_z, tnear, dir_x, dir_y, dir_z, time, tfar, mask, id, flags }
        RTCRay8 { org_x, org_y, org_z, tnear, dir_x, dir_y, dir_z, time, tfar, mask, id, flags }
        RTCRay16 { org_x, org_y, org_z, tnear, dir_x, dir_y, dir_z, time, tfar, mask, id, flags }
        RTCHit { Ng_x, Ng_y, Ng_z, u, v, primID, geomID, instID, instPrimID }
        RTCHit8 { Ng_x, Ng_y, Ng_z, u, v, primID, geomID, instID, instPrimID }
        RTCHit16 { Ng_x, Ng_y, Ng_z, u, v, primID, geomID, instID, instPrimID }
        RTCRayHit { ray, hit }
        RTCRayHit8 { ray, hit }
        RTCRayHit16 { ray, hit }
        RTCIntersectArguments { flags, feature_mask, context, filter, intersect }
        RTCOccludedArguments { flags, feature_mask, context, filter, occluded }
    }
    values! { facts,
        RTC_VERSION
        RTC_MAX_INSTANCE_LEVEL_COUNT
        RTC_ERROR_NONE RTC_ERROR_OUT_OF_MEMORY RTC_ERROR_UNSUPPORTED_CPU
        RTC_DEVICE_PROPERTY_VERSION RTC_DEVICE_PROPERTY_RAY_MASK_SUPPORTED
        RTC_DEVICE_PROPERTY_TRIANGLE_GEOMETRY_SUPPORTED RTC_DEVICE_PROPERTY_BACKFACE_CULLING_ENABLED
        RTC_DEVICE_PROPERTY_NATIVE_RAY8_SUPPORTED RTC_DEVICE_PROPERTY_NATIVE_RAY16_SUPPORTED
        RTC_GEOMETRY_TYPE_TRIANGLE RTC_GEOMETRY_TYPE_INSTANCE
        RTC_BUFFER_TYPE_INDEX RTC_BUFFER_TYPE_VERTEX
        RTC_FORMAT_UINT3 RTC_FORMAT_FLOAT3 RTC_FORMAT_FLOAT3X4_COLUMN_MAJOR
        RTC_BUILD_QUALITY_LOW RTC_BUILD_QUALITY_MEDIUM RTC_BUILD_QUALITY_HIGH
        RTC_SCENE_FLAG_NONE RTC_SCENE_FLAG_ROBUST
        RTC_RAY_QUERY_FLAG_COHERENT RTC_RAY_QUERY_FLAG_INCOHERENT
        RTC_FEATURE_FLAG_ALL
    }
    facts.add("RTC_INVALID_GEOMETRY_ID", "RTC_INVALID_GEOMETRY_ID", i64::from(INVALID_ID));
    facts
}

#[test]
fn bindings_have_the_c_compilers_layout() {
    let facts = facts();
    let dir = std::path::Path::new(env!("CARGO_TARGET_TMPDIR"));
    let (source, program) = (dir.join("layout.c"), dir.join("layout"));
    let text = format!(
        "#include <stddef.h>\n#include <stdio.h>\n#include <embree4/rtcore.h>\nint main(void) {{\n{}return 0;\n}}\n",
        facts.c
    );
    std::fs::write(&source, text).expect("the target folder is writable");
    let compiler = std::env::var("CC").unwrap_or_else(|_| "cc".into());
    let compiled = Command::new(&compiler)
        .arg(format!("-I{}", env!("EMBREE_INCLUDE_DIR")))
        .arg(&source)
        .arg("-o")
        .arg(&program)
        .output()
        .expect("the C compiler that ./setup looks for");
    assert!(compiled.status.success(), "{compiler}: {}", String::from_utf8_lossy(&compiled.stderr));
    let printed = Command::new(&program).output().expect("the program was just built");
    assert!(printed.status.success());
    let c = String::from_utf8(printed.stdout).expect("the program prints ASCII");
    assert!(c.lines().count() > 100, "the program printed too little:\n{c}");
    for (rust, c) in facts.rust.lines().zip(c.lines()) {
        assert_eq!(rust, c, "bindings (left) and C compiler (right) disagree");
    }
    assert_eq!(facts.rust, c);
}

/// The member that the headers of 4.2 do not have: the library writes it at every hit.
#[test]
fn a_hit_packet_ends_after_the_primitive_of_the_instance() {
    let end = offset_of!(RTCHit16, instPrimID) + 16 * 4 * RTC_MAX_INSTANCE_LEVEL_COUNT as usize;
    assert_eq!(size_of::<RTCHit16>(), end);
}
