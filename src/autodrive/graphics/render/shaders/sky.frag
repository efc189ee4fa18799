// The sky. SHARPER: levels of detail of the clouds that are added, because pixels of a coarse image are larger.
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
    vec3 d = normalize(ray), seen = sky_light(d);
#ifdef AIR
    seen = mix(horizon.rgb * 0.31831, seen, exp(-3.0 * exposure.z / (max(d.z, 0.0) + 0.02)));  // a layer of 3 m
#endif
    pixel = vec4(shown(seen * exposure.x), 1.0);
}
