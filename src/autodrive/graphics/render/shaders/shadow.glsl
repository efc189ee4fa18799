// Shadows. TAPS: samples for a soft edge.
uniform sampler2DShadow caster_map;

float shadow(sampler2DShadow map, vec3 at, vec2 texel) {
#if TAPS == 1
    return texture(map, at);
#else
    float sum = 0.0;
    for (int i = -1; i <= 1; i++)
        for (int j = -1; j <= 1; j++) sum += texture(map, at + vec3(vec2(i, j) * texel, 0.0));
    return sum / 9.0;
#endif
}

// Share of the sun that static meshes and objects let pass. `at`: place in their shadow map.
float unshaded(sampler2DShadow map, vec3 at) {
    vec2 off = abs(at.xy - 0.5);
    return max(off.x, off.y) < 0.499 ? shadow(map, at, vec2(still_scale.w)) : 1.0;
}

// Share of the sun that passes beside the vehicle in that slot. `in_sun`: place in the axes of the sun.
float beside(int slot, vec3 in_sun) {
    vec4 tile = caster_tile[slot];
    vec3 at = in_sun * tile_scale.zzw + caster_offset[slot].xyz, off = abs(at - 0.5);
    bool inside = max(off.x, off.y) < 0.48 &&  // filtering at the border would read the next tile
                  at.z < 1.0 && tile.w > 0.0;
    float lit = shadow(caster_map, vec3(tile.xy + at.xy * tile_scale.x, at.z), vec2(tile_scale.y));
    return inside ? lit : 1.0;
}
