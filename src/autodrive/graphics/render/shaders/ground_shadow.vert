// Triangles of the ground z = 0 where shadows of static meshes and objects can be.
layout(std140) uniform Frame { FRAME_FIELDS };
layout(std140) uniform Camera { mat4 clip_from_map; vec4 eye; };
in vec2 place;
out vec3 at;  // in the static shadow map
void main() {
    at = mat3(sun_from_map) * vec3(place, still_offset.w) * still_scale.xyz + still_offset.xyz;
    gl_Position = clip_from_map * vec4(place, 0.0, 1.0);
}
