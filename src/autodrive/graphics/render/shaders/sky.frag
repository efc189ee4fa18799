// The sky. SHARPER: levels of detail of the clouds that are added, because pixels of a coarse image are larger.
// WIDE: without what is too small for it, which shaders/coarse_sky.frag adds.
layout(std140) uniform Frame { FRAME_FIELDS };
#ifdef CLOUDS
uniform sampler2DArray textures;
uniform float layer;
vec2 cloud_noise(vec2 at) { return texture(textures, vec3(at, layer), -SHARPER).rg; }
#endif
in vec3 ray;
out vec4 pixel;
TONE
SKY_LIGHT
void main() {
    vec3 d = normalize(ray);
#ifdef WIDE
    vec4 seen = wide_light(d);
#else
    vec4 seen = vec4(sky_light(d), 1.0);
#endif
#ifdef AIR
    float share = exp(-3.0 * exposure.z / (max(d.z, 0.0) + 0.02));  // a layer of 3 m
    seen = vec4(mix(horizon.rgb * 0.31831, seen.rgb, share), share * seen.a);
#endif
    pixel = vec4(shown(seen.rgb * exposure.x), seen.a);
}
