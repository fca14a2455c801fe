//! Checks of messages.

use super::geometry::{cross, length, sub, wide};
use super::{At, Checked, Problem, ValueError, count, position, range, ranges, unit, whole};
use crate::limits::{
    FOV_Y, MAX_BATCH, MAX_CREDITS, MAX_HOLDS, MAX_LIGHTS, MAX_MOVES, MAX_NAME, MAX_RADIANCE,
    MAX_SHADOWS, MAX_SIDE, MAX_TEXT, MAX_TRIPLES, MIN_SIGHT, MIN_UP_SINE,
};
use crate::messages::{
    Camera, Capabilities, LightShadows, NO_OBJECT, Sample, SampleRequest, ShadowMethod,
    TexturedSample, ToDisplay, ToServer, flags,
};
use crate::scene::MAX_CHUNK;
use crate::validate::{validate_light, validate_transform};

/// Checks what a display sent.
///
/// # Errors
/// The first value that is not allowed.
pub fn validate_to_server(message: &ToServer) -> Checked {
    match message {
        ToServer::Hello {
            min_version,
            max_version,
            name,
            ..
        } => {
            if min_version > max_version || *min_version == 0 {
                let problem = Problem::Other("the range of versions is empty or starts at 0");
                return Err(ValueError {
                    place: "Hello.min_version".into(),
                    problem,
                });
            }
            count(name.len(), 0, MAX_NAME).at(|| "Hello.name".into())
        }
        ToServer::SceneBegin { .. }
        | ToServer::Cancel { .. }
        | ToServer::Ping { .. }
        | ToServer::Goodbye => Ok(()),
        ToServer::SceneChunk { data } => {
            count(data.len(), 1, MAX_CHUNK).at(|| "SceneChunk.data".into())
        }
        ToServer::Fault { text, .. } => count(text.len(), 0, MAX_TEXT).at(|| "Fault.text".into()),
        ToServer::Shadows { error, methods, .. } => {
            range(*error, 0.0, 1.0).at(|| "Shadows.error".into())?;
            count(methods.len(), 0, MAX_LIGHTS).at(|| "Shadows.methods".into())
        }
        ToServer::View { camera, .. } => validate_camera(camera).map_err(|e| e.inside("View")),
        ToServer::Request { samples, .. } => validate_requests(samples),
        ToServer::Edit {
            objects, lights, ..
        } => {
            count(objects.len(), 0, MAX_MOVES).at(|| "Edit.objects".into())?;
            count(lights.len(), 0, MAX_MOVES).at(|| "Edit.lights".into())?;
            for (i, moved) in objects.iter().enumerate() {
                validate_transform(&moved.transform)
                    .at(|| format!("Edit.objects[{i}].transform"))?;
            }
            for (i, moved) in lights.iter().enumerate() {
                validate_light(&moved.value)
                    .map_err(|error| error.inside(&format!("Edit.lights[{i}].value")))?;
            }
            Ok(())
        }
    }
}

/// Checks what a server sent.
///
/// # Errors
/// The first value that is not allowed.
pub fn validate_to_display(message: &ToDisplay) -> Checked {
    match message {
        ToDisplay::Welcome {
            name,
            shader,
            capabilities,
            holds,
            ..
        } => {
            count(name.len(), 0, MAX_NAME).at(|| "Welcome.name".into())?;
            count(shader.len(), 0, MAX_NAME).at(|| "Welcome.shader".into())?;
            count(holds.len(), 0, MAX_HOLDS).at(|| "Welcome.holds".into())?;
            validate_capabilities(capabilities)
        }
        ToDisplay::Samples { samples, .. } => validate_samples(samples),
        ToDisplay::Textured { samples, .. } => validate_textured(samples),
        ToDisplay::Triples { triples, .. } => {
            count(triples.len(), 1, MAX_TRIPLES).at(|| "Triples.triples".into())
        }
        ToDisplay::Shadows { lights } => validate_shadows(lights),
        ToDisplay::Fault { text, .. } => count(text.len(), 0, MAX_TEXT).at(|| "Fault.text".into()),
        ToDisplay::SceneReady { .. } | ToDisplay::Status { .. } | ToDisplay::Pong { .. } => Ok(()),
    }
}

/// Checks that a camera sees something: [`Camera`] says what must hold, [`crate::limits`] by how much.
///
/// # Errors
/// The first value that is not allowed.
pub fn validate_camera(camera: &Camera) -> Checked {
    position(camera.eye).at(|| "camera.eye".into())?;
    position(camera.target).at(|| "camera.target".into())?;
    position(camera.up).at(|| "camera.up".into())?;
    range(camera.fov_y, FOV_Y[0], FOV_Y[1]).at(|| "camera.fov_y".into())?;
    whole(camera.width, 1, MAX_SIDE).at(|| "camera.width".into())?;
    whole(camera.height, 1, MAX_SIDE).at(|| "camera.height".into())?;
    let sight = sub(wide(camera.target), wide(camera.eye));
    if length(sight) < f64::from(MIN_SIGHT) {
        let problem = Problem::Other("is the eye itself, so that there is no line of sight");
        return Err(ValueError {
            place: "camera.target".into(),
            problem,
        });
    }
    let up = wide(camera.up);
    let sine = length(cross(sight, up)) / (length(sight) * length(up));
    if sine >= f64::from(MIN_UP_SINE) {
        Ok(())
    } else {
        let problem = Problem::Other("is zero or parallel to the line of sight");
        Err(ValueError {
            place: "camera.up".into(),
            problem,
        })
    }
}

fn validate_requests(samples: &[SampleRequest]) -> Checked {
    count(samples.len(), 1, MAX_BATCH as usize).at(|| "Request.samples".into())?;
    for (i, request) in samples.iter().enumerate() {
        for (axis, &value) in request.offset.iter().enumerate() {
            range(value, 0.0, 1.0f32.next_down())
                .at(|| format!("Request.samples[{i}].offset[{axis}]"))?;
        }
    }
    Ok(())
}

fn validate_capabilities(capabilities: &Capabilities) -> Checked {
    whole(capabilities.credits, 1, MAX_CREDITS).at(|| "Welcome.capabilities.credits".into())?;
    whole(capabilities.max_batch, 1, MAX_BATCH).at(|| "Welcome.capabilities.max_batch".into())
}

/// Checks shaded samples: radiance and place finite and in bounds, flags known and in keeping with each other.
///
/// # Errors
/// The first value that is not allowed.
pub fn validate_samples(samples: &[Sample]) -> Checked {
    count(samples.len(), 1, MAX_BATCH as usize).at(|| "Samples.samples".into())?;
    for (i, sample) in samples.iter().enumerate() {
        validate_sample(sample).map_err(|e| e.inside(&format!("Samples.samples[{i}]")))?;
    }
    Ok(())
}

fn validate_sample(sample: &Sample) -> Checked {
    ranges(&sample.radiance, 0.0, MAX_RADIANCE).at(|| "radiance".into())?;
    validate_flags(sample).at(|| "flags".into())?;
    if sample.flags & flags::MISS != 0 {
        unit(sample.position).at(|| "position".into())
    } else {
        position(sample.position).at(|| "position".into())
    }
}

fn validate_textured(samples: &[TexturedSample]) -> Checked {
    count(samples.len(), 1, MAX_BATCH as usize).at(|| "Textured.samples".into())?;
    for (i, TexturedSample { sample, texel }) in samples.iter().enumerate() {
        let at = |field: &str| format!("Textured.samples[{i}].{field}");
        validate_sample(sample).map_err(|e| e.inside(&at("sample")))?;
        ranges(&texel.reflectance, 0.0, 1.0).at(|| at("texel.reflectance"))?;
        ranges(&texel.reflected, 0.0, MAX_RADIANCE).at(|| at("texel.reflected"))?;
        if sample.flags & (flags::MISS | flags::LIGHT) != 0 {
            let problem = Problem::Other("is no hit on an object, so that it has no texture");
            return Err(problem).at(|| at("sample.flags"));
        }
    }
    Ok(())
}

fn validate_shadows(lights: &[LightShadows]) -> Checked {
    count(lights.len(), 1, MAX_SHADOWS).at(|| "Shadows.lights".into())?;
    for (i, light) in lights.iter().enumerate() {
        count(light.why.len(), 0, MAX_NAME).at(|| format!("Shadows.lights[{i}].why"))?;
        if light.method == ShadowMethod::Auto {
            let problem = Problem::Other("is Auto, which is a wish and no method");
            return Err(problem).at(|| format!("Shadows.lights[{i}].method"));
        }
    }
    Ok(())
}

fn validate_flags(sample: &Sample) -> Result<(), Problem> {
    let miss = sample.flags & flags::MISS != 0;
    if sample.flags & !flags::ALL != 0 {
        Err(Problem::Other("has bits without a meaning"))
    } else if miss && sample.flags & flags::LIGHT != 0 {
        Err(Problem::Other("is both a miss and a hit on a light"))
    } else if miss != (sample.object == NO_OBJECT) {
        Err(Problem::Other("a miss has no object, a hit has one"))
    } else {
        Ok(())
    }
}

#[cfg(test)]
#[path = "message_tests.rs"]
mod tests;
