// The share of a pixel that a strip covers, times its paint and its shade. Shares of strips side by side add up.
in vec4 own_strip;
in vec2 own_amounts;
out vec4 pixel;
void main() {
    vec2 off = own_strip.xz, half_extent = own_strip.yw, wide = max(fwidth(off), 1e-6);
    vec2 share = clamp((half_extent - off) / wide + 0.5, 0.0, 1.0) + clamp((half_extent + off) / wide + 0.5, 0.0, 1.0) - 1.0;
    share = max(share, 0.0);
    pixel = vec4(own_amounts * share.x * share.y, 0.0, 0.0);
}
