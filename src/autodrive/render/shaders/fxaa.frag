// Fast approximate anti-aliasing (T. Lottes, 2009): smooths along edges of brightness, which is stored in alpha.
uniform sampler2D drawn;
uniform vec2 texel;
out vec4 pixel;
float luma(ivec2 at) { return texelFetch(drawn, at, 0).a; }
void main() {
    ivec2 c = clamp(ivec2(gl_FragCoord.xy), ivec2(1), textureSize(drawn, 0) - 2);  // keeps all neighbours inside the image
    float nw = luma(c + ivec2(-1, -1)), ne = luma(c + ivec2(1, -1)), sw = luma(c + ivec2(-1, 1)), se = luma(c + ivec2(1, 1));
    vec4 own = texelFetch(drawn, ivec2(gl_FragCoord.xy), 0);
    float low = min(own.a, min(min(nw, ne), min(sw, se))), high = max(own.a, max(max(nw, ne), max(sw, se)));
    vec2 along = vec2(sw + se - nw - ne, nw + sw - ne - se);
    float scale = 1.0 / (min(abs(along.x), abs(along.y)) + max((nw + ne + sw + se) * 0.03125, 0.0078125));
    along = clamp(along * scale, -8.0, 8.0) * texel;
    vec2 at = gl_FragCoord.xy * texel;
    vec4 near = 0.5 * (texture(drawn, at - along / 6.0) + texture(drawn, at + along / 6.0));
    vec4 wide = 0.5 * near + 0.25 * (texture(drawn, at - along * 0.5) + texture(drawn, at + along * 0.5));
    vec4 smoothed = wide.a < low || wide.a > high ? near : wide;
    pixel = vec4(high - low < max(0.03, high * 0.125) ? own.rgb : smoothed.rgb, 1.0);
}
