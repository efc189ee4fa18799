// The ground that each vehicle dims: a square around its place and its shadow, two triangles for each vehicle.
layout(std140) uniform Frame { FRAME_FIELDS };
layout(std140) uniform Camera { mat4 clip_from_map; vec4 eye; };
uniform vec3 area;  // how far the shadow of a vehicle reaches beyond it, along x and y; half the width of the square [m]
out vec3 place;
flat out int slot;
void main() {
    slot = gl_VertexID / 6;
    int corner = gl_VertexID - 6 * slot;
    float far = length(area.xy);
    vec2 along = far > 1e-6 ? area.xy / far : vec2(1.0, 0.0);
    vec2 at = vec2(corner == 1 || corner == 2 || corner == 4 ? far + area.z : -area.z, corner < 2 || corner == 3 ? -area.z : area.z);
    place = vec3(caster_place[slot].xy + at.x * along + at.y * vec2(-along.y, along.x), 0.0);
    gl_Position = clip_from_map * vec4(place, 1.0);
}
