// Fast approximate anti-aliasing (T. Lottes, 2009): smooths along edges of brightness.
uniform sampler2D drawn;
uniform vec2 texel;
out vec4 pixel;
const vec3 LUMA = vec3(0.299, 0.587, 0.114);
float luma(ivec2 at) { return dot(texelFetch(drawn, at, 0).rgb, LUMA); }
void main() {
    ivec2 c = clamp(ivec2(gl_FragCoord.xy), ivec2(1), textureSize(drawn, 0) - 2);  // neighbours are within the picture
    float nw = luma(c + ivec2(-1, -1)), ne = luma(c + ivec2(1, -1)), sw = luma(c + ivec2(-1, 1)), se = luma(c + ivec2(1, 1));
    vec3 own = texelFetch(drawn, ivec2(gl_FragCoord.xy), 0).rgb;
    float m = dot(own, LUMA), low = min(m, min(min(nw, ne), min(sw, se))), high = max(m, max(max(nw, ne), max(sw, se)));
    vec2 along = vec2(sw + se - nw - ne, nw + sw - ne - se);
    float scale = 1.0 / (min(abs(along.x), abs(along.y)) + max((nw + ne + sw + se) * 0.03125, 0.0078125));
    along = clamp(along * scale, -8.0, 8.0) * texel;
    vec2 at = gl_FragCoord.xy * texel;
    vec3 near = 0.5 * (texture(drawn, at - along / 6.0).rgb + texture(drawn, at + along / 6.0).rgb);
    vec3 wide = 0.5 * near + 0.25 * (texture(drawn, at - along * 0.5).rgb + texture(drawn, at + along * 0.5).rgb);
    float y = dot(wide, LUMA);
    vec3 smoothed = y < low || y > high ? near : wide;
    pixel = vec4(high - low < max(0.03, high * 0.125) ? own : smoothed, 1.0);
}
