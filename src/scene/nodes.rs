//! The node hierarchy: a forest, walked without recursion, to world transforms.

use super::LoadReport;
use super::document::{Document, one_line};
use super::raw::Fields;
use crate::error::Result;
use glam::{Affine3A, Mat4, Quat, Vec3, Vec4};
use gltf::json::Node;

/// A node of the rendered scene.
pub(super) struct Placed {
    pub(super) node: usize,
    pub(super) to_world: Affine3A,
}

/// Every node below the rendered scene's roots, parents first, in file order.
pub(super) fn walk(document: &Document, report: &mut LoadReport) -> Result<Vec<Placed>> {
    let nodes = &document.root.nodes;
    let is_child = check_forest(document)?;
    let roots = roots(document, &is_child, report)?;
    let mut placed = Vec::with_capacity(nodes.len());
    let mut stack: Vec<(usize, Affine3A)> =
        roots.into_iter().rev().map(|n| (n, Affine3A::IDENTITY)).collect();
    while let Some((index, parent)) = stack.pop() {
        let Some(node) = nodes.get(index) else { continue };
        let to_world = parent * local_transform(document, index, node, report)?;
        if !to_world.is_finite() {
            let what = "its transform is not finite in world space; check the scales of its parents";
            return Err(document.reject(format!("nodes[{index}]"), what));
        }
        for child in node.children.iter().flatten().rev() {
            stack.push((child.value(), to_world));
        }
        placed.push(Placed { node: index, to_world });
    }
    Ok(placed)
}

/// No node has two parents and none is its own ancestor; says which nodes are children.
fn check_forest(document: &Document) -> Result<Vec<bool>> {
    let nodes = &document.root.nodes;
    let mut parents: Vec<Option<usize>> = vec![None; nodes.len()];
    for (i, node) in nodes.iter().enumerate() {
        for (k, child) in node.children.iter().flatten().enumerate() {
            let Some(parent) = parents.get_mut(child.value()) else { continue };
            if let Some(first) = *parent {
                let what =
                    format!("node {} already is a child of node {first}; nodes form a tree", child.value());
                return Err(document.reject(format!("nodes[{i}].children[{k}]"), what));
            }
            *parent = Some(i);
        }
    }
    // Each node is seen by one walk towards the root; meeting the walk's own mark again is a cycle.
    let mut seen_by: Vec<Option<usize>> = vec![None; nodes.len()];
    for start in 0..nodes.len() {
        let mut at = Some(start);
        while let Some(i) = at {
            match seen_by.get_mut(i) {
                Some(mark) if mark.is_none() => *mark = Some(start),
                Some(mark) if *mark == Some(start) => {
                    return Err(
                        document.reject(format!("nodes[{i}]"), "is its own ancestor; nodes form a tree")
                    );
                }
                _ => break,
            }
            at = parents.get(i).copied().flatten();
        }
    }
    Ok(parents.iter().map(Option::is_some).collect())
}

/// The roots of the default scene; without scenes, all nodes that have no parent.
fn roots(document: &Document, is_child: &[bool], report: &mut LoadReport) -> Result<Vec<usize>> {
    let root = &document.root;
    let index = root.scene.map_or(0, |s| s.value());
    let Some(scene) = root.scenes.get(index) else {
        return Ok((0..root.nodes.len()).filter(|&i| is_child.get(i) == Some(&false)).collect());
    };
    if root.scenes.len() > 1 {
        let name = scene.name.as_deref().map_or_else(String::new, |n| format!(" ({})", one_line(n)));
        report.warn(format!("the file has {} scenes; scene {index}{name} is read", root.scenes.len()));
    }
    let mut taken = vec![false; root.nodes.len()];
    let mut roots = Vec::with_capacity(scene.nodes.len());
    for (k, node) in scene.nodes.iter().enumerate() {
        let i = node.value();
        let repeated = taken.get_mut(i).is_none_or(|t| std::mem::replace(t, true));
        if repeated || is_child.get(i) != Some(&false) {
            let what = format!("node {i} is not a root, or listed twice; export the file again");
            return Err(document.reject(format!("scenes[{index}].nodes[{k}]"), what));
        }
        roots.push(i);
    }
    Ok(roots)
}

fn local_transform(document: &Document, i: usize, node: &Node, report: &mut LoadReport) -> Result<Affine3A> {
    let finite = |values: &[f32], key: &str| {
        if values.iter().all(|v| v.is_finite()) {
            return Ok(());
        }
        Err(document.reject(format!("nodes[{i}].{key}"), "holds a number that is not finite"))
    };
    if let Some(m) = &node.matrix {
        finite(m, "matrix")?;
        let matrix = Mat4::from_cols_array(m);
        if matrix.row(3) != Vec4::W {
            report.warn(format!("nodes[{i}].matrix: is not affine; its last row is taken as 0 0 0 1"));
        }
        return Ok(Affine3A::from_mat4(matrix));
    }
    let translation = node.translation.unwrap_or([0.0; 3]);
    let scale = node.scale.unwrap_or([1.0; 3]);
    let rotation = node.rotation.map_or([0.0, 0.0, 0.0, 1.0], |q| q.0);
    finite(&translation, "translation")?;
    finite(&scale, "scale")?;
    finite(&rotation, "rotation")?;
    if rotation == [0.0; 4] {
        report.warn(format!("nodes[{i}].rotation: is zero; no rotation is used"));
    }
    Ok(Affine3A::from_scale_rotation_translation(
        Vec3::from_array(scale),
        unit_quaternion(rotation),
        Vec3::from_array(translation),
    ))
}

fn unit_quaternion(q: [f32; 4]) -> Quat {
    // In f64: the squares of small or large components leave f32.
    let length = q.iter().map(|&v| f64::from(v) * f64::from(v)).sum::<f64>().sqrt();
    if length > 0.0 && length.is_finite() {
        Quat::from_array(q.map(|v| (f64::from(v) / length) as f32))
    } else {
        Quat::IDENTITY
    }
}

/// Where the node's mesh stands: once, or at every instance of EXT_mesh_gpu_instancing.
pub(super) fn mesh_placements(document: &Document, placed: &Placed) -> Result<Vec<Affine3A>> {
    let at = format!("nodes[{}]", placed.node);
    let others = document.root.nodes.get(placed.node).and_then(|n| n.extensions.as_ref()).map(|e| &e.others);
    let Some(extension) = Fields::extension(document, others, &at, "EXT_mesh_gpu_instancing")? else {
        return Ok(vec![placed.to_world]);
    };
    let Some(attributes) = extension.child("attributes")? else { return Ok(vec![placed.to_world]) };
    let translations = instance_values::<3>(document, &attributes, "TRANSLATION")?;
    let rotations = instance_values::<4>(document, &attributes, "ROTATION")?;
    let scales = instance_values::<3>(document, &attributes, "SCALE")?;
    let lengths = [
        translations.as_ref().map(Vec::len),
        rotations.as_ref().map(Vec::len),
        scales.as_ref().map(Vec::len),
    ];
    let mut lengths = lengths.into_iter().flatten();
    let Some(count) = lengths.next() else { return Ok(vec![placed.to_world]) };
    if lengths.any(|n| n != count) {
        return Err(document.reject(extension.at("attributes"), "its accessors differ in length"));
    }
    document.budget.take_array(count as u64, size_of::<Affine3A>() as u64, "instances")?;
    let mut out = Vec::with_capacity(count);
    for k in 0..count {
        let get3 = |values: &Option<Vec<[f32; 3]>>, default: Vec3| {
            values.as_ref().and_then(|v| v.get(k)).map_or(default, |v| Vec3::from_array(*v))
        };
        let rotation =
            rotations.as_ref().and_then(|v| v.get(k)).map_or(Quat::IDENTITY, |q| unit_quaternion(*q));
        let local = Affine3A::from_scale_rotation_translation(
            get3(&scales, Vec3::ONE),
            rotation,
            get3(&translations, Vec3::ZERO),
        );
        let to_world = placed.to_world * local;
        if !to_world.is_finite() {
            let what = format!("instance {k} has a transform that is not finite");
            return Err(document.reject(extension.at("attributes"), what));
        }
        out.push(to_world);
    }
    Ok(out)
}

fn instance_values<const N: usize>(
    document: &Document,
    attributes: &Fields,
    name: &str,
) -> Result<Option<Vec<[f32; N]>>> {
    let Some(accessor) = attributes.integer(name)? else { return Ok(None) };
    let accessor = usize::try_from(accessor).unwrap_or(usize::MAX);
    document.read_floats(accessor, &attributes.at(name)).map(Some)
}
