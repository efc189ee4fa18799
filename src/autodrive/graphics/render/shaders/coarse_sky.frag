// The sky of a view, from an image of it with fewer pixels. STARS: what is too small for that image is added.
layout(std140) uniform Frame { FRAME_FIELDS };
uniform sampler2D behind;
uniform vec4 size;  // of the image of the sky, and of the whole image, whose rows are before those of the sky [pixels]
in vec3 ray;
noperspective in vec2 at;
out vec4 pixel;
SKY_LIGHT
void main() {
    vec2 own = clamp(at * size.xy, vec2(0.5), size.xy - 0.5);  // no pixel of another image
    pixel = texture(behind, (own + vec2(0.0, size.w)) / (size.zw + vec2(0.0, size.y)));
#ifdef STARS
    vec3 more = small_light(normalize(ray), pixel.a) * exposure.x;
    pixel.rgb = min(sqrt(pixel.rgb * pixel.rgb + more), 1.0);  // nearly as light adds up
#endif
}
