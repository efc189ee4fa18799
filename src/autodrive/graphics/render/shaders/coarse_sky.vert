// A triangle that covers the viewport at the far plane, with the place of its corners in the image.
noperspective out vec2 at;
void main() {
    vec2 corner = vec2((gl_VertexID & 1) * 4 - 1, (gl_VertexID >> 1) * 4 - 1);
    at = 0.5 * corner + 0.5;
    gl_Position = vec4(corner, 0.9999999, 1.0);
}
