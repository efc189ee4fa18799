// Fast approximate anti-aliasing (T. Lottes, 2009): smooths along edges of brightness.
uniform sampler2D drawn;
uniform vec2 texel;
in vec2 corner;
out vec4 pixel;
float luma(vec3 c) { return dot(c, vec3(0.299, 0.587, 0.114)); }
void main() {
    vec2 at = gl_FragCoord.xy * texel;
    vec3 own = texture(drawn, at).rgb;
    float m = luma(own);
    float nw = luma(textureOffset(drawn, at, ivec2(-1, -1)).rgb), ne = luma(textureOffset(drawn, at, ivec2(1, -1)).rgb);
    float sw = luma(textureOffset(drawn, at, ivec2(-1, 1)).rgb), se = luma(textureOffset(drawn, at, ivec2(1, 1)).rgb);
    float low = min(m, min(min(nw, ne), min(sw, se))), high = max(m, max(max(nw, ne), max(sw, se)));
    vec2 along = vec2(sw + se - nw - ne, nw + sw - ne - se);
    float scale = 1.0 / (min(abs(along.x), abs(along.y)) + max((nw + ne + sw + se) * 0.03125, 0.0078125));
    along = clamp(along * scale, -8.0, 8.0) * texel;
    vec3 near = 0.5 * (texture(drawn, at - along / 6.0).rgb + texture(drawn, at + along / 6.0).rgb);
    vec3 wide = 0.5 * near + 0.25 * (texture(drawn, at - along * 0.5).rgb + texture(drawn, at + along * 0.5).rgb);
    float y = luma(wide);
    vec3 smoothed = y < low || y > high ? near : wide;
    pixel = vec4(high - low < max(0.03, high * 0.125) ? own : smoothed, 1.0);
}
