using System;
using System.Collections.Generic;
using System.Diagnostics;
using System.Threading;
using System.Threading.Tasks;
using Nep;

/// <summary>Tests public members that other tests do not use; prints "ok" or the failed expectation.</summary>
internal static class Api
{
    private static int Main()
    {
        try
        {
            Run();
            Console.WriteLine("ok");
            return 0;
        }
        catch (Exception exception)
        {
            Console.WriteLine(exception.ToString().Replace("\n", " "));
            return 1;
        }
    }

    private static void Run()
    {
        using (var node = new Node("api"))
        {
            Subscriber subscriber = node.CreateSubscriber("topic");
            Publisher publisher = node.CreatePublisher("topic");
            var cancellation = new CancellationTokenSource();
            Task<Message> pending = subscriber.ReceiveAsync(cancellation.Token);
            publisher.Publish(new { number = 1.5, nothing = double.NaN });
            var value = pending.Result.As<Dictionary<string, double?>>();
            Expect(value["number"] == 1.5 && value["nothing"] == null, "NaN becomes null");
            pending = subscriber.ReceiveAsync(cancellation.Token);
            cancellation.Cancel();
            Expect(Fails<OperationCanceledException>(() => pending.GetAwaiter().GetResult()), "cancellation");
            var awaited = new List<Task<Message>>();
            for (int i = 0; i < 300; i++)
            {
                awaited.Add(subscriber.ReceiveAsync(CancellationToken.None));
            }
            Expect(Process.GetCurrentProcess().Threads.Count < 200, "no thread for each task");
            for (int i = 0; i < 300; i++)
            {
                publisher.Publish(i);
            }
            for (int i = 0; i < 300; i++)
            {
                Expect(awaited[i].Result.As<int>() == i, "tasks get messages in order");
            }
            Message message;
            Expect(!subscriber.TryReceive(TimeSpan.Zero, out message), "nothing is left");
            Expect(Fails<PayloadException>(() => publisher.Publish(Nested(65))), "too deep");
            Expect(Fails<ArgumentException>(() => node.CreatePublisher("with space")), "topic");
            UpdateHasABudget(node, publisher);
            Services(node);
            subscriber.Close();
            Expect(subscriber.Receive() == null, "closed");
            Subscriber silent = node.CreateSubscriber("silent");
            pending = silent.ReceiveAsync(CancellationToken.None);
            silent.Close();
            Expect(pending.Result == null, "closed while a task waits");
            publisher.Close();
            Expect(Fails<ObjectDisposedException>(() => publisher.Publish(1)), "closed publisher");
        }
    }

    private static void UpdateHasABudget(Node node, Publisher publisher)
    {
        int called = 0;
        var failures = 0;
        node.CallbackFailed += (sender, arguments) => failures++;
        var options = new SubscriberOptions { Callbacks = CallbackMode.Update };
        using (Subscription subscription = node.Subscribe("topic", message => { called++; throw new InvalidOperationException(); }, "json", options))
        {
            for (int i = 0; i < 5; i++)
            {
                publisher.Publish(i);
            }
            SpinWait.SpinUntil(() => subscription.Subscriber.Received == 5, 10000);
            Expect(node.Update(TimeSpan.Zero) == 1 && called == 1, "one callback without time");
            Expect(node.Update(TimeSpan.FromSeconds(10)) == 4 && failures == 5, "all callbacks");
        }
    }

    private static void Services(Node node)
    {
        using (node.CreateServer<int, int>("double", number => 2 * number))
        using (Client client = node.CreateClient("double"))
        {
            Expect(client.CallAsync<int>(21, TimeSpan.FromSeconds(10)).Result == 42, "service");
            Expect(Fails<RequestRefusedException>(() => client.Call<int>("text", TimeSpan.FromSeconds(10))), "refused");
        }
    }

    private static object Nested(int levels)
    {
        object value = 1;
        for (int i = 0; i < levels; i++)
        {
            value = new[] { value };
        }
        return value;
    }

    private static bool Fails<T>(Action action) where T : Exception
    {
        try
        {
            action();
            return false;
        }
        catch (T)
        {
            return true;
        }
    }

    private static void Expect(bool isTrue, string what)
    {
        if (!isTrue)
        {
            throw new InvalidOperationException("expected: " + what);
        }
    }
}
