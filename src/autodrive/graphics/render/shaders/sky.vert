// A triangle that covers the viewport at the far plane, with the view direction of its corners and their place in the image.
uniform mat4 map_from_clip;
out vec3 ray;
noperspective out vec2 at;
void main() {
    vec2 corner = vec2((gl_VertexID & 1) * 4 - 1, (gl_VertexID >> 1) * 4 - 1);
    vec4 near = map_from_clip * vec4(corner, -1.0, 1.0), far = map_from_clip * vec4(corner, 1.0, 1.0);
    ray = far.xyz / far.w - near.xyz / near.w;
    at = 0.5 * corner + 0.5;
    gl_Position = vec4(corner, 0.9999999, 1.0);
}
