// A triangle that covers the viewport at the far plane, with the place of its corners in the coarse image of the sky.
uniform vec4 size;  // of the image of the sky, and of the whole image, whose rows are before those of the sky [pixels]
noperspective out vec2 at;
void main() {
    vec2 corner = vec2((gl_VertexID & 1) * 4 - 1, (gl_VertexID >> 1) * 4 - 1);
    vec2 own = 0.5 + (0.5 * corner + 0.5) * (size.xy - 1.0);  // from centre to centre of its outer pixels
    at = (own + vec2(0.0, size.w)) / (size.zw + vec2(0.0, size.y));
    gl_Position = vec4(corner, 0.9999999, 1.0);
}
