import json, random, sys, os, time
mode=sys.argv[1] if len(sys.argv)>1 else ''
slp=float(os.environ.get('SLP','0'))
if mode=='banner': print('Loading licence ... OK', flush=True)
n=0
for line in sys.stdin:
    r=json.loads(line); n+=1
    if mode=='chatty' : print('iteration 1 residual 1e-3', flush=True)
    if mode=='once' and n==3: print('WARNING: deprecated option', flush=True)
    if r["request"]=="describe": a={"protocol":2,"version":"bowl 1"}
    else:
        d=r["design"]; y=(d["x"]-.5)**2+(d["y"]+.5)**2
        if r["request"]=="evaluate": a={k:y for k in r["responses"]}
        else:
            if slp: time.sleep(slp)
            a={"depth":y+.1*random.Random(sum(w<<(32*i) for i,w in enumerate(r["seed"]))).gauss(0,1)}
    a["id"]=r["id"]; print(json.dumps(a),flush=True)
    if mode=='twice': print(json.dumps(a),flush=True)
    if mode=='after': print('done in 0.1 s', flush=True)
