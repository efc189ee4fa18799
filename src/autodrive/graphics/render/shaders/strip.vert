// Strips on the ground, wider than they are by about a pixel; see `assets/asset.py`, `Strips`.
layout(std140) uniform Camera { mat4 clip_from_map; vec4 eye; };
uniform vec2 half_size;  // of the image [pixels]
in vec2 place;
in vec4 outward, strip;
in vec2 amounts;
out vec4 own_strip;
out vec2 own_amounts;
void main() {
    vec4 clip = clip_from_map * vec4(place, 0.0, 1.0);
    vec2 at = clip.xy / clip.w;
    // pixels per metre along x and y of the ground; from them, metres per pixel across and along the strip
    vec2 by_x = half_size * (clip_from_map[0].xy - at * clip_from_map[0].w) / clip.w;
    vec2 by_y = half_size * (clip_from_map[1].xy - at * clip_from_map[1].w) / clip.w;
    vec4 slope = outward.xxzz * by_y.yxyx - outward.yyww * by_x.yxyx;
    vec2 pixel = (abs(slope.xz) + abs(slope.yw)) / abs(by_x.x * by_y.y - by_x.y * by_y.x);
    vec2 wider = vec2(pixel.x / max(dot(outward.xy, outward.xy), 1e-6), pixel.y);
    // not as far as the camera, and nothing behind it
    wider = clip.w > 0.0 ? min(0.8 * wider, vec2(0.5 * clip.w)) : vec2(0.0);
    own_strip = strip + vec4(sign(strip.x) * wider.x, 0.0, sign(strip.z) * wider.y, 0.0);
    own_amounts = amounts;
    gl_Position = clip_from_map * vec4(place + wider.x * outward.xy + wider.y * outward.zw, 0.0, 1.0);
}
