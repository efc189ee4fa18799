// The sky of a view, from an image of it with fewer pixels.
uniform sampler2D behind;
uniform vec4 size;  // of the image of the sky, and of the whole image, whose rows are before those of the sky [pixels]
noperspective in vec2 at;
out vec4 pixel;
void main() {
    vec2 own = clamp(at * size.xy, vec2(0.5), size.xy - 0.5);  // no pixel of another image
    pixel = texture(behind, (own + vec2(0.0, size.w)) / (size.zw + vec2(0.0, size.y)));
}
