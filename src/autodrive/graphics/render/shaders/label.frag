// Semantic label of each pixel; its depth along the optical axis [m], which the depth buffer knows less exactly; and its
// instance number. `only`: nothing is seen but that instance; 0: all are seen.
uniform float only;
#ifdef JOINTED
uniform float number;
#endif
in vec3 place, facing, in_sun;
flat in vec3 own_color, own_emission;
flat in vec4 own_finish;
in vec3 own_uv;
flat in float own_instance;
layout(location = 0) out vec4 pixel;
layout(location = 1) out vec2 depth_instance;
void main() {
#ifdef JOINTED
    float instance = number;
#else
    float instance = own_instance;
#endif
    if (only > 0.0 && instance != only) discard;
    pixel = vec4(own_finish.w / 255.0, 0.0, 0.0, 1.0);
    depth_instance = vec2(1.0 / gl_FragCoord.w, instance);
}
