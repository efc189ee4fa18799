// Vertices of the scene, in map axes. JOINTED: each vertex moves with a bone of its vehicle or object.
layout(std140) uniform Frame { FRAME_FIELDS };
layout(std140) uniform Camera { mat4 clip_from_map; vec4 eye; };

in vec3 position, normal, color, emission;
in vec2 uv;
in float open;     // share of the sky that the vertex sees
in vec4 finish;  // roughness, metallic, texture layer, label
in float instance;
#ifdef JOINTED
uniform mat4 bones[BONES];
uniform float lamps[13];  // 0: surfaces that always glow; 1 to 12: the lamps
in vec2 bone_lamp;
#endif

out vec3 place, facing, in_sun;
flat out vec3 own_color, own_emission;
flat out vec4 own_finish;
out vec3 own_uv;  // and `open`
flat out float own_instance;
#ifdef FLAT
flat out vec3 from_sky, from_sun;
#elif defined(MATT)
out vec3 from_sky, from_sun;  // reflected by a white surface
#endif

void main() {
#ifdef JOINTED
    mat4 bone = bones[int(bone_lamp.x)];
    place = (bone * vec4(position, 1.0)).xyz;
    facing = mat3(bone) * normal;
    own_emission = emission * lamps[int(bone_lamp.y)];
#else
    place = position;
    facing = normal;
    own_emission = emission;
#endif
    own_color = color;
    own_finish = finish;
    own_uv = vec3(uv, open);
    own_instance = instance;
    in_sun = mat3(sun_from_map) * (place + still_offset.w * facing);  // offset from the surface, against shadow acne
#if defined(FLAT) || defined(MATT)
    from_sky = 0.31831 * mix(floor_glow.rgb, 0.5 * (zenith.rgb + horizon.rgb), facing.z * 0.5 + 0.5);
    from_sun = 0.31831 * clamp(dot(facing, sun_direction.xyz), 0.0, 1.0) * sun_color.rgb;
#endif
    gl_Position = clip_from_map * vec4(place, 1.0);
}
