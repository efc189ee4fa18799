// A triangle that covers the viewport.
out vec2 corner;
void main() {
    corner = vec2((gl_VertexID & 1) * 4 - 1, (gl_VertexID >> 1) * 4 - 1);
    gl_Position = vec4(corner, 0.9999999, 1.0);
}
