import os
from pathlib import Path
from autodrive.protocol.messages import Command, Headlights, Pause, SetSceneLight, Step, SetWeather, SetTimeOfDay, Weather
from tests.support.page import *
OUT=Path(os.environ['LOOK_OUT']); Q=os.environ.get('LOOK_Q','high')
def test_look(mini_map, new_tab):
    OUT.mkdir(parents=True,exist_ok=True)
    for q in Q.split(','):
        tab=new_tab(size=(1280,720),draws=True).open(f"{mini_map.url}?quality={q}")
        tab.wait_for_image(); mini_map.request(Pause())
        for name,day,tod,w in (('day',True,None,Weather()),('dusk',True,17.6*3600,Weather()),('night',False,None,Weather()),('rain',True,12*3600.,Weather(rain=.8,wetness=1.)),('snow',True,12*3600.,Weather(snow=.7,snow_cover=1.))):
            if tod is not None: mini_map.request(SetTimeOfDay(tod))
            else: mini_map.request(SetSceneLight(day))
            mini_map.request(SetWeather(w))
            f=mini_map.request(Step(1,{"V1":Command(headlights=Headlights.OFF if day else Headlights.LOW)}))
            tab.wait_until(lambda: tab.value("store.frame.value.tick")==f.tick)
            tab.page.evaluate("() => { window.drawn = 0; const next = () => (drawn++, requestAnimationFrame(next)); next() }")
            tab.wait_until(lambda: tab.page.evaluate("() => window.drawn")>2)
            tab.page.screenshot(path=str(OUT/f"{q}-{name}.png"),timeout=120000)
        tab.page.close()
